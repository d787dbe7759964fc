"""The model layer: assembling a request, its tokens, and many calls at once.

    python benchmarks/models.py [--only L1,L2,L3] [--calls 40] [--latency 40]

Prints one JSON object a line.

* ``L1``: CPU time from 5 new frames (the four views and a key picture) and 20 remembered pictures,
  all of 640 x 480 pixels, to the bytes of a request: JPEG encoding of the new ones, prompt and
  body.  Beside it, all 25 frames as PNG, the way of sending each picture anew.  Frames are drawn
  in the apartment.
* ``L2``: input tokens of an episode's calls, see ``prompt_tokens.py``.
* ``L3``: calls at the same time from one process through the whole client, to a server in another
  process that answers each after some seconds.
"""

from __future__ import annotations

import argparse
import asyncio
import concurrent.futures
import io
import json
import os
import re
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from chosen import names_among
from cost import cpu_ms, resident_mb
from numpy.typing import NDArray
from PIL import Image
from prompt_tokens import token_rows
from rendering import Bench, row

from unilavira_drake.messages import DIRECTIONS, TodoItem
from unilavira_drake.mllm.gemini import GeminiDialect
from unilavira_drake.mllm.openai_compatible import OpenAiDialect
from unilavira_drake.mllm.profile import Profile, RoleSettings
from unilavira_drake.mllm.profiles import load_profile
from unilavira_drake.mllm.prompt import compose_prompt
from unilavira_drake.mllm.remote import RemoteModel
from unilavira_drake.mllm.request import (
    DecisionNote,
    ImagePart,
    LanguageVariables,
    MllmRequest,
    ViewNote,
    WaypointNote,
)
from unilavira_drake.sensors.encoding import encode_jpeg, rgb_of

Frame = NDArray[np.uint8]
NEW, HISTORY = 5, 20
REPEATS = 12
PNG_REPEATS = 3
TARGET, TARGET_MB = 50.0, 2.5
REPLY = {"todo": ["Leave the room.", "Stop at the sofa."], "reasoning": "Two steps."}


def frames(count: int) -> list[Frame]:
    """Returns camera pictures of the apartment."""
    bench = Bench("apartment", cameras=("raster",))
    pictures = []
    for X in bench.poses(count, 17):
        bench.look(X)
        pictures.append(rgb_of(bench.pull("raster", ("color_image",))[0]))
    return pictures


def decide(history: Sequence[ImagePart], views: Sequence[bytes], latest: bytes) -> MllmRequest:
    """Returns the request of a late decision."""
    number = len(history) + 1
    waypoints = tuple(
        WaypointNote(
            id=i + 1,
            distance=1.5 * i,
            bearing=40.0 * i,
            heading=20.0 * i,
            target="white door",
            scene="a corridor with doors on both sides",
            tried=("front: arrived at waypoint 3", "left: failed: unreachable"),
            offered=True,
            picture=f"H{2 * i + 1}",
        )
        for i in range(10)
    )
    todo = ("Leave the bedroom", "Turn left in the corridor", "Stop at the refrigerator")
    pictures = tuple(
        ImagePart(f"view {direction}", view, "medium")
        for direction, view in zip(DIRECTIONS, views, strict=True)
    )
    return MllmRequest(
        n=12,
        call="decide",
        variables=LanguageVariables(
            task="Leave the bedroom, turn left in the corridor and stop at the refrigerator.",
            views=tuple(ViewNote(direction, 2.0) for direction in DIRECTIONS),
            last_action="turn left to 'white door'",
            outcome="arrived",
            todo=tuple(TodoItem(content=content) for content in todo),
            current_waypoint=10,
            waypoints=waypoints,
            decisions=tuple(
                DecisionNote(n, "at waypoint 2: turn left to 'white door': arrived")
                for n in range(4, 12)
            ),
        ),
        images=(*history, ImagePart(f"H{number}: on the way", latest, "low"), *pictures),
    )


def body(dialect: Any, profile: Profile, request: MllmRequest) -> bytes:
    """Returns a request's bytes on the wire."""
    settings = profile.settings("language")
    data: bytes = dialect.body(
        compose_prompt(request),
        request,
        profile,
        structured=profile.structured,
        temperature=settings.temperature,
        max_output_tokens=settings.max_output_tokens,
    )
    return data


def as_png(pictures: Sequence[Frame]) -> int:
    """Encodes pictures as Pillow does by default and returns the bytes of all."""
    size = 0
    for picture in pictures:
        out = io.BytesIO()
        Image.fromarray(picture).save(out, "PNG")
        size += out.tell()
    return size


def assembly() -> None:
    """Prints L1 for both dialects."""
    pictures = frames(HISTORY + NEW * REPEATS)
    shown = pictures[: HISTORY + NEW]
    png = statistics.median(cpu_ms(lambda: as_png(shown)) for _ in range(PNG_REPEATS))
    fast_png = cpu_ms(lambda: [cv2.imencode(".png", picture) for picture in shown])
    for name, dialect, profile in (
        ("gemini", GeminiDialect(), load_profile("gemini-3.1-pro")),
        ("openai", OpenAiDialect(), load_profile("qwen3.5-27b")),
    ):
        ours, size = assembled(pictures, dialect, profile)
        row(
            f"L1.{name}",
            f"a request of {NEW} new and {HISTORY} remembered pictures: {NEW + HISTORY} PNG / ours",
            png / ours,
            "x",
            target=TARGET,
            ours_ms=round(ours, 3),
            png_ms=round(png, 1),
            opencv_png_ratio=round(fast_png / ours, 1),
            opencv_png_ms=round(fast_png, 1),
        )
        row(
            f"L1.{name}.size",
            "the same request's body",
            size / 1e6,
            "MB",
            target=TARGET_MB,
            sense="<=",
            png_base64_mb=round(as_png(shown) * 4 / 3 / 1e6, 2),
        )


def assembled(pictures: Sequence[Frame], dialect: Any, profile: Profile) -> tuple[float, int]:
    """Returns the median CPU milliseconds of requests with new pictures, and the largest size."""
    past = tuple(
        ImagePart(f"H{number}: on the way", encode_jpeg(picture), "low")
        for number, picture in enumerate(pictures[:HISTORY], start=1)
    )
    # The call before had the remembered pictures, too.
    body(dialect, profile, decide(past, [past[0].jpeg] * len(DIRECTIONS), past[0].jpeg))
    sizes = []

    def assemble(new: Sequence[Frame]) -> None:
        latest, *views = [encode_jpeg(picture) for picture in new]
        sizes.append(len(body(dialect, profile, decide(past, views, latest))))

    starts = range(HISTORY, len(pictures), NEW)
    spent = [cpu_ms(lambda i=start: assemble(pictures[i : i + NEW])) for start in starts]
    return statistics.median(spent), max(sizes)


async def serve(latency: float) -> None:
    """Answers each POST after some seconds, on a port that it prints; ends with its stdin."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while head := await head_of(reader):
            length = re.search(rb"(?i)content-length: *(\d+)", head)
            await reader.readexactly(int(length[1]) if length else 0)
            await asyncio.sleep(latency)
            choice = {"message": {"content": json.dumps(REPLY)}, "finish_reason": "stop"}
            usage = {"prompt_tokens": 9000, "completion_tokens": 40}
            data = json.dumps({"choices": [choice], "usage": usage}).encode()
            writer.write(
                b"HTTP/1.1 200 OK\r\ncontent-type: application/json\r\n"
                b"content-length: %d\r\n\r\n%s" % (len(data), data)
            )
            await writer.drain()

    server = await asyncio.start_server(answer, "127.0.0.1", 0)
    print(server.sockets[0].getsockname()[1], flush=True)
    await asyncio.to_thread(sys.stdin.read)
    os._exit(0)  # Open connections would only complain.


async def head_of(reader: asyncio.StreamReader) -> bytes:
    """Returns the head of the next request; empty when the client has gone."""
    try:
        return await reader.readuntil(b"\r\n\r\n")
    except (asyncio.IncompleteReadError, ConnectionError):
        return b""


def concurrency(calls: int, latency: float) -> None:
    """Prints L3."""
    server = subprocess.Popen(
        [sys.executable, __file__, "--serve", str(latency)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert server.stdout is not None
    port = int(server.stdout.readline())
    settings = RoleSettings(attempt_deadline=latency + 60.0, deadline=latency + 60.0)
    profile = Profile(
        name="slow",
        description="a server that thinks",
        dialect="openai",
        base_url=f"http://127.0.0.1:{port}/v1",
        model="slow",
        language=settings,
    )
    pictures = [encode_jpeg(picture) for picture in frames(HISTORY + NEW)]
    past = tuple(ImagePart(f"H{i}: on the way", jpeg, "low") for i, jpeg in enumerate(pictures[5:]))
    request = decide(past, pictures[:4], pictures[4])
    model = RemoteModel(profile, role="language")
    with concurrent.futures.ThreadPoolExecutor(calls) as pool:
        memory = resident_mb()
        wall, cpu = time.perf_counter(), time.process_time()
        replies = list(pool.map(model.complete, [request] * calls))
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    grown = resident_mb() - memory
    server.communicate("")
    assert all(reply.usage.output_tokens == 40 for reply in replies)
    more = {"calls": calls, "latency_s": latency, "images": len(request.images)}
    what = f"{calls} calls at the same time to a server that takes {latency:g} s"
    row("L3.wall", f"{what}: wall time over the ideal", wall / latency, "x", target=1.1,
        sense="<=", wall_s=round(wall, 2), **more)  # fmt: skip
    row("L3.cpu", "CPU time of the client's process over wall time", cpu / wall, "1", target=0.2,
        sense="<=", cpu_s=round(cpu, 2), memory_mb=round(grown, 1), **more)  # fmt: skip


def main() -> None:
    """Prints the rows."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument(
        "--only",
        type=names_among("row", ("L1", "L2", "L3")),
        default="L1,L2,L3",
        help="which rows, of L1,L2,L3; default: all",
    )
    parser.add_argument("--calls", type=int, default=40, help="calls at the same time (L3)")
    parser.add_argument("--latency", type=float, default=40.0, help="of the server (L3), seconds")
    parser.add_argument("--serve", type=float, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.serve is not None:
        asyncio.run(serve(arguments.serve))
        return
    if not arguments.only:
        parser.error("argument --only: name a row")
    if "L1" in arguments.only:
        assembly()
    if "L2" in arguments.only:
        token_rows(row)
    if "L3" in arguments.only:
        concurrency(arguments.calls, arguments.latency)


if __name__ == "__main__":
    main()
