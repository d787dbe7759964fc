"""A detector of one's own mends marks of which the vision model is unsure.

The model here marks beside things and says so.  The second episode asks the detector about that.
"""

import json

import cv2

from unilavira_drake import load_scenario, run_episode
from unilavira_drake.messages import Candidate, Grounding
from unilavira_drake.mllm.broker import Broker
from unilavira_drake.mllm.latency import NoLatency
from unilavira_drake.mllm.reply import Completion
from unilavira_drake.mllm.rules import RulesModel
from unilavira_drake.model_link import ModelLink
from unilavira_drake.vision.grounder import Grounder
from unilavira_drake.vision.grounding import from_pictures

HUES = {"red": (0, 8), "yellow": (22, 34), "green": (40, 80), "blue": (100, 125)}


def detect(color, depth, target_desc, box):
    """Returns the parts of the picture in the colour that the description names."""
    word = next((word for word in target_desc.split() if word in HUES), None)
    if word is None:
        return []
    low, high = HUES[word]
    mask = cv2.inRange(cv2.cvtColor(color, cv2.COLOR_RGB2HSV), (low, 100, 0), (high, 255, 255))
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    found = [cv2.boundingRect(contour) for contour in contours]
    largest = max((w * h for _, _, w, h in found), default=0)
    return [Candidate((u, v, u + w, v + h), w * h / largest) for u, v, w, h in found]


class Unsure(RulesModel):
    """Moves each box to the left by most of its width, and says that it is not sure."""

    def complete(self, request):
        reply = json.loads(super().complete(request).text)
        if reply.get("box"):
            u_min, v_min, u_max, v_max = reply["box"]
            shift = min(0.8 * (u_max - u_min), u_min)
            reply |= {"box": [u_min - shift, v_min, u_max - shift, v_max], "confidence": 0.3}
        return Completion(json.dumps(reply))


def show(t, system, event, message):
    """Prints what the detector has changed."""
    if isinstance(message, Grounding) and message.refined:
        print(f"  {message.doubt}: {message.action.target_desc} -> {message.action.box}")


if __name__ == "__main__":
    scenario = load_scenario("flat", "{task: {text: '@bed'}, budgets: {decisions: 8}}")
    for own in ({}, {"grounder": Grounder(propose=from_pictures(detect), period=0.1)}):
        unsure = ModelLink(broker=Broker(Unsure()), latency=NoLatency(), period=0.1)
        result = run_episode(scenario, on_event=show, replace={"vision_link": unsure, **own})
        error = result.metrics.navigation_error_m
        print(f"{'with' if own else 'without'} the detector: {error:.2f} m from the goal")
