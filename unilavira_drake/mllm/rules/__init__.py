"""``rules``: a small parser and reasoner on the simulator's labels, not a multimodal LLM."""

from unilavira_drake.mllm.rules.dials import RULES_PRESETS, RulesDials, read_dials
from unilavira_drake.mllm.rules.model import RulesModel

__all__ = ["RULES_PRESETS", "RulesDials", "RulesModel", "read_dials"]
