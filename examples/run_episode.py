"""One episode in Python; ``unilavira run`` calls the same functions."""

from unilavira_drake import load_scenario, run_episode

scenario = load_scenario("apartment", overlay="task: {text: '@fridge'}")
result = run_episode(scenario, on_event=lambda t, system, event, _: print(f"{t:6.2f} {system}"))

print(result.cause, result.success, result.metrics)
