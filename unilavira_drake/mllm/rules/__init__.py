"""``rules``: a small parser and reasoner on the simulator's labels, not a multimodal LLM."""

from unilavira_drake.mllm.rules.model import RulesModel

__all__ = ["RulesModel"]
