#!/usr/bin/env python3
"""Writes a tiny vision projector with random weights, so that a text model accepts pictures.

llama.cpp's server takes pictures only if it is started with a projector file (``--mmproj``)
beside its language model.  This script writes such a file for any language model:

    pip install gguf numpy
    python make_tiny_mmproj.py model.gguf mmproj.gguf
    llama-server -m model.gguf --mmproj mmproj.gguf

Nobody trained the weights: they are drawn at random, and pictures mean nothing to the model.  The
pair serves protocol tests only: whether a client's requests with pictures are understood, what the
answers and the errors look like, how many tokens are counted.  What the model says about a picture
must never be used as a result.

The file describes a vision transformer of two blocks with llama.cpp's ``gemma3`` projector, which
needs no special tokens in the vocabulary.  Each picture is resized to a square of 16 tokens.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import gguf
import numpy as np
from numpy.typing import NDArray

_IMAGE_SIZE = 128  # pixels along each side of the resized picture
_PATCH_SIZE = 16  # pixels along each side of a patch
_POOLING = 2  # patches along each side that are averaged into one token
_WIDTH = 64
_HIDDEN_WIDTH = 128  # must differ from _WIDTH: the server tells the matrices apart by it
_HEADS = 2
_BLOCKS = 2
_OUTPUT_SCALE = 0.1  # roughly the size of a language model's own token embeddings


def embedding_length(language_model: Path) -> int:
    """Returns how many numbers make up one token in a language model's GGUF file."""
    for name, field in gguf.GGUFReader(language_model).fields.items():
        if name.endswith(".embedding_length"):
            return int(field.contents())
    raise ValueError(f"{language_model} does not tell the length of its embeddings")


def random_weights(token_length: int, seed: int) -> dict[str, NDArray[np.float32]]:
    """Draws all tensors of the projector, under the names that llama.cpp looks for."""
    generator = np.random.default_rng(seed)

    def matrix(*shape: int, scale: float = 1.0) -> NDArray[np.float32]:
        """Draws a matrix (outputs first) that keeps the size of what it is multiplied with."""
        spread = scale / math.sqrt(math.prod(shape[1:]))
        return generator.normal(0.0, spread, shape).astype(np.float32)

    ones = np.ones(_WIDTH, np.float32)
    zeros = np.zeros(_WIDTH, np.float32)
    patches = (_IMAGE_SIZE // _PATCH_SIZE) ** 2
    projection = matrix(token_length, _WIDTH, scale=_OUTPUT_SCALE).T  # stored inputs first
    weights = {
        "v.patch_embd.weight": matrix(_WIDTH, 3, _PATCH_SIZE, _PATCH_SIZE),
        "v.patch_embd.bias": zeros,
        "v.position_embd.weight": matrix(patches, _WIDTH),
        "v.post_ln.weight": ones,
        "v.post_ln.bias": zeros,
        "mm.input_projection.weight": np.ascontiguousarray(projection),
        "mm.soft_emb_norm.weight": ones,
    }
    for index in range(_BLOCKS):
        block = f"v.blk.{index}"
        for norm in ("ln1", "ln2"):
            weights[f"{block}.{norm}.weight"] = ones
            weights[f"{block}.{norm}.bias"] = zeros
        for part in ("attn_q", "attn_k", "attn_v", "attn_out"):
            weights[f"{block}.{part}.weight"] = matrix(_WIDTH, _WIDTH)
        weights[f"{block}.ffn_up.weight"] = matrix(_HIDDEN_WIDTH, _WIDTH)
        weights[f"{block}.ffn_down.weight"] = matrix(_WIDTH, _HIDDEN_WIDTH)
    return weights


def write_projector(path: Path, token_length: int, seed: int = 0) -> None:
    """Writes the projector for a language model whose tokens have ``token_length`` numbers."""
    writer = gguf.GGUFWriter(path, "clip")
    writer.add_name("random projector for protocol tests")
    writer.add_clip_has_vision_encoder(True)
    writer.add_clip_projector_type("gemma3")
    writer.add_vision_image_size(_IMAGE_SIZE)
    writer.add_vision_patch_size(_PATCH_SIZE)
    writer.add_vision_projector_scale_factor(_POOLING)
    writer.add_vision_embedding_length(_WIDTH)
    writer.add_vision_feed_forward_length(_HIDDEN_WIDTH)
    writer.add_vision_block_count(_BLOCKS)
    writer.add_vision_head_count(_HEADS)
    writer.add_vision_attention_layernorm_eps(1e-6)
    writer.add_vision_projection_dim(token_length)
    writer.add_vision_image_mean([0.5, 0.5, 0.5])
    writer.add_vision_image_std([0.5, 0.5, 0.5])
    writer.add_vision_use_gelu(True)
    for name, tensor in random_weights(token_length, seed).items():
        writer.add_tensor(name, tensor)
    writer.write_header_to_file()
    writer.write_kv_data_to_file()
    writer.write_tensors_to_file()
    writer.close()


def main() -> None:
    """Reads the command line and writes the file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("model", type=Path, help="the language model's GGUF file")
    parser.add_argument("output", type=Path, help="the projector's GGUF file, to be written")
    arguments = parser.parse_args()
    write_projector(arguments.output, embedding_length(arguments.model))


if __name__ == "__main__":
    main()
