"""Registry of metrics: metrics of this package, of installed packages and of the running program.

An installed package adds a metric through the entry-point group ``teleop_core.metrics``; a program through
``METRICS.add("jerk", JerkMetric)``. Every score contains every metric of the registry.
"""

import inspect
from collections.abc import Callable, Iterable

from teleop_core.base import PartError, Registry
from teleop_core.evaluation.metric import Key, Metric
from teleop_core.graph import topics

SESSION = "session"
"""Reserved name in JSON, which no metric may have."""
_FOLDER = "teleop_core.evaluation.metrics"


def check_metric(name: str, part: object) -> type[Metric]:
    """Return the part if it is a valid metric.

    Raises:
        PartError: The part is not a metric; the error text names what is missing.
    """
    if not (isinstance(part, type) and issubclass(part, Metric)):
        raise _refusal(name, f"a class below teleop_core.evaluation.Metric, is {part!r}")
    if missing := sorted(getattr(part, "__abstractmethods__", ())):
        raise _refusal(name, f"a class with the methods add and values, lacks {missing[0]}")
    told = (key.path.partition(".")[2] for key in part.keys if isinstance(key, Key))
    if part.values is Metric.values and not all(hasattr(part, one) for one in told):
        raise _refusal(name, "a class with figures or with the methods add and values, lacks values")
    own = getattr(part, "name", None)
    if own != name or name == SESSION or not name or "." in name:
        raise _refusal(name, f"registered under its own name without dots, which is {own!r}")
    for method, names in (
        ("__init__", "self, context"),
        ("add", "self, window"),
        ("values", "self"),
        ("rows", "self"),
        ("figures", "self"),
    ):
        if not _takes(getattr(part, method, None), names.count(",") + 1):
            raise _refusal(name, f"a class with {method}({names})")
    _check_keys(name, part.place(), part.keys)
    if not isinstance(part.topics, tuple) or not all(map(_is_stream, part.topics)):
        raise _refusal(name, f"a class with a tuple of streams as topics, not {part.topics!r}")
    return part


def _is_stream(topic: object) -> bool:
    return isinstance(topic, topics.Topic) and topic.kind is not topics.Kind.REPORT


def _takes(method: Callable[..., object] | None, count: int) -> bool:
    """Whether a method can be called with ``count`` arguments."""
    if not callable(method):
        return False
    try:
        inspect.signature(method).bind(*range(count))
    except TypeError:
        return False
    return True


def _check_keys(name: str, place: str, keys: object) -> None:
    if not isinstance(keys, tuple):
        raise _refusal(name, f"a class with a tuple of Key as keys, not {keys!r}")
    known: set[str] = set()
    for key in keys:
        is_key = isinstance(key, Key) and all(isinstance(text, str) and text for text in key)
        if not is_key:
            raise _refusal(name, f"a class whose keys are Key(path, unit, meaning), not {key!r}")
        if not key.path.startswith(f"{place}."):
            raise _refusal(name, f"a class whose keys begin with '{place}.', not {key.path!r}")
        for single in key.names():
            if single in known:
                raise _refusal(name, f"a class with each key once, has {single!r} twice")
            known.add(single)


def _refusal(name: str, expected: str) -> PartError:
    return PartError("metric", name, expected)


METRICS: Registry[type[Metric]] = Registry(
    "metric",
    "metrics",
    {
        "samples": f"{_FOLDER}.counts:SamplesMetric",
        "gap": f"{_FOLDER}.breaks:GapMetric",
        "halt": f"{_FOLDER}.breaks:HaltMetric",
        "path": f"{_FOLDER}.path:PathMetric",
        "reach": f"{_FOLDER}.reach:ReachMetric",
        "asked_error_mm": f"{_FOLDER}.asked_error:AskedErrorMetric",
        "asked_error_deg": f"{_FOLDER}.asked_error:AskedTurnMetric",
        "position_error_mm": f"{_FOLDER}.position_error:PositionErrorMetric",
        "orientation_error_deg": f"{_FOLDER}.orientation_error:OrientationErrorMetric",
        "true_error_mm": f"{_FOLDER}.position_error:TrueErrorMetric",
        "command_error_mm": f"{_FOLDER}.position_error:CommandErrorMetric",
        "command_orientation_error_deg": (f"{_FOLDER}.orientation_error:CommandOrientationErrorMetric"),
        "fixture": f"{_FOLDER}.fixture:FixtureMetric",
        "force_n": f"{_FOLDER}.force:ForceMetric",
        "contact": f"{_FOLDER}.contact:ContactMetric",
        "touch": f"{_FOLDER}.touch:TouchMetric",
        "insertion": f"{_FOLDER}.insertion:InsertionMetric",
        "network": f"{_FOLDER}.network:NetworkMetric",
        "passivity": f"{_FOLDER}.passivity:PassivityMetric",
        "remote_centre": f"{_FOLDER}.remote_centre:RemoteCentreMetric",
        "jaw": f"{_FOLDER}.jaw:JawMetric",
        "jaw_delay": f"{_FOLDER}.jaw_delay:JawDelayMetric",
        "jaw_curves": f"{_FOLDER}.jaw_curves:JawCurvesMetric",
        "transfer": f"{_FOLDER}.transfer:TransferMetric",
        "waits": f"{_FOLDER}.waits:WaitsMetric",
        "looks": f"{_FOLDER}.looks:LooksMetric",
        "clutches": f"{_FOLDER}.clutches:ClutchesMetric",
        "economy": f"{_FOLDER}.economy:EconomyMetric",
        "force_peaks": f"{_FOLDER}.force_peaks:ForcePeaksMetric",
        "step_s": f"{_FOLDER}.steps:StepsMetric",
        "task": f"{_FOLDER}.task:TaskMetric",
        "throughput": f"{_FOLDER}.throughput:ThroughputMetric",
        "misses": f"{_FOLDER}.misses:MissesMetric",
        "display": f"{_FOLDER}.display:DisplayMetric",
        "force_sensing": f"{_FOLDER}.force_sensing:ForceSensingMetric",
        "tremor_filter": f"{_FOLDER}.tremor_filter:TremorFilterMetric",
        "motion": f"{_FOLDER}.motion:MotionMetric",
        "latency_ms": f"{_FOLDER}.latency:LatencyMetric",
        "ticks": f"{_FOLDER}.counts:TicksMetric",
        "nodes": f"{_FOLDER}.counts:NodesMetric",
        "topics": f"{_FOLDER}.counts:TopicsMetric",
    },
    check_metric,
)
"""All metrics, in the order of the score."""


def all_metrics(further: Iterable[type[Metric]] = ()) -> list[type[Metric]]:
    """Metrics of the registry, and further metrics that are not in it.

    Raises:
        PartError: A part is not a metric, or has the name of another metric.
    """
    found = {name: METRICS.find(name) for name in METRICS}
    for part in further:
        name = str(getattr(part, "name", getattr(part, "__name__", part)))
        if name in found:
            raise PartError("metric", name, "a name that is free; this one is used already")
        found[name] = check_metric(name, part)
    return list(found.values())


def register_metric(metric: type[Metric], *, replace: bool = False) -> type[Metric]:
    """Add a metric under its own name for the rest of the program; see :meth:`Registry.add`."""
    fallback = getattr(metric, "__name__", type(metric).__name__)
    return METRICS.add(getattr(metric, "name", fallback), metric, replace=replace)
