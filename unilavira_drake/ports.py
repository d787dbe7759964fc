"""Typed ports and the level: every quirk of Drake's Python bindings lives here.

Drake wraps any Python object as ``Value[object]`` and connects ports of different Python types
without a word.  The readers below check the type at each read and name the system, the port and
both types.  State outputs declare their prerequisites, otherwise Drake would assume feedthrough
and refuse the ring as an algebraic loop.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import (
    BasicVector,
    Context,
    EventStatus,
    InputPortIndex,
    LeafSystem,
    State,
)

from unilavira_drake.errors import PortTypeError

T = TypeVar("T")


class InputReader(Generic[T]):
    """Reads one abstract input port and checks what it carries."""

    def __init__(self, system: LeafSystem, name: str, type_: type[T], model: AbstractValue) -> None:
        self._system = system
        self._type = type_
        self._name = name
        self._index = int(system.DeclareAbstractInputPort(name, model).get_index())

    @property
    def ticket(self) -> Any:
        """Dependency ticket of the port."""
        return self._system.input_port_ticket(InputPortIndex(self._index))

    def __call__(self, context: Context) -> T:
        """Returns the value on the port.

        Raises:
            PortTypeError: if nothing is connected, or the value has another type.
        """
        value = self.optional(context)
        if value is None:
            raise PortTypeError(
                f"{self._system.GetSystemPathname()}: input port {self._name!r} is not connected; "
                f"connect an output that carries {self._type.__name__}."
            )
        return value

    def optional(self, context: Context) -> T | None:
        """Returns the value on the port, or None when nothing is connected.

        Raises:
            PortTypeError: if the value has another type.
        """
        # Half as dear as to ask the port itself whether there is a value, and then for it.
        held: Any = self._system.EvalAbstractInput(context, self._index)
        if held is None:
            return None
        value = held.get_value()
        if not isinstance(value, self._type):
            raise PortTypeError(
                f"{self._system.GetSystemPathname()}: input port {self._name!r} expects "
                f"{self._type.__name__} and got {type(value).__name__}."
            )
        return value


def message_input(system: LeafSystem, name: str, default: T) -> InputReader[T]:
    """Declares an input port for messages of the type of ``default``."""
    return InputReader(system, name, type(default), AbstractValue.Make(default))


def pose_input(system: LeafSystem, name: str) -> InputReader[RigidTransform]:
    """Declares an input port for a ``RigidTransform``."""
    return InputReader(system, name, RigidTransform, Value[RigidTransform]())


def image_input(system: LeafSystem, name: str, image_type: type[T]) -> InputReader[T]:
    """Declares an input port for one of Drake's image types."""
    return InputReader(system, name, image_type, Value[image_type]())


def pixels(image: Any) -> NDArray[Any]:
    """Returns the (H, W, channels) pixels of a Drake image: a view, valid for this time only."""
    data: NDArray[Any] = image.data
    return data


def pose_matrix(X: RigidTransform) -> NDArray[np.float64]:
    """Returns a pose as a (4, 4) float64 matrix."""
    matrix: Any = X.GetAsMatrix4()
    return np.asarray(matrix, dtype=np.float64)


def pose_numbers(X: RigidTransform) -> list[float]:
    """Returns the (3, 4) matrix of a pose row by row: NumPy takes ten times as long for so few."""
    matrix: Any = X.GetAsMatrix34()
    numbers: list[float] = matrix.ravel().tolist()
    return numbers


class VectorReader:
    """Reads one vector input port."""

    def __init__(self, system: LeafSystem, name: str, size: int) -> None:
        self._system = system
        self._name = name
        self._size = size
        self._port = system.DeclareVectorInputPort(name, BasicVector(size))

    @property
    def ticket(self) -> Any:
        """Dependency ticket of the port."""
        return self._system.input_port_ticket(self._port.get_index())

    def __call__(self, context: Context) -> NDArray[np.float64]:
        """Returns the (size,) float64 vector on the port.

        Raises:
            PortTypeError: if nothing is connected.
        """
        try:
            value: Any = self._port.Eval(context)
        except (RuntimeError, ValueError):
            if self._port.HasValue(context):
                raise
            raise PortTypeError(
                f"{self._system.GetSystemPathname()}: input port {self._name!r} is not connected; "
                f"connect a vector of size {self._size}."
            ) from None
        vector: NDArray[np.float64] = value
        return vector


def vector_input(system: LeafSystem, name: str, size: int) -> VectorReader:
    """Declares an input port for a vector of ``size``."""
    return VectorReader(system, name, size)


OFFSET = 0.125
"""Share of its period after which a level is first polled.

Drake applies the updates of one moment together: a level that is polled when the plant steps has
its state copied and its outputs computed anew, though it had nothing to do.  An eighth of a tick
of 0.1 s is no multiple of any usual plant step (5, 10 or 25 ms).
"""


DID_NOTHING = EventStatus.DidNothing()
SUCCEEDED = EventStatus.Succeeded()


class Level(LeafSystem):
    """A System with one frozen abstract state, polled at a fixed period.

    A subclass declares its inputs, publishes views of its state with :meth:`declare_output`, and
    overrides :meth:`step`.  Polling stands in for events at exact times, which Drake's Python
    bindings cannot schedule; an idle poll returns ``DidNothing`` and copies nothing.

    Args:
        initial_state: frozen.
        period: of the polls, seconds.
        offset: time of the first poll, seconds; by default an eighth of the period.
    """

    def __init__(self, initial_state: Any, *, period: float, offset: float | None = None) -> None:
        super().__init__()
        if offset is None:
            offset = OFFSET * period
        index = self.DeclareAbstractState(AbstractValue.Make(initial_state))
        self._state_index = int(index)
        self._state_tickets = {self.abstract_state_ticket(index)}
        self._mirror: tuple[int, Callable[[Any], NDArray[np.float64]]] | None = None
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, offset, self._tick)

    def declare_output(self, name: str, view: Callable[[Any], Any], default: Any) -> None:
        """Declares an abstract output port that shows a view of the state."""

        def show(context: Any, output: Any) -> None:
            output.set_value(view(self.state(context)))

        self.DeclareAbstractOutputPort(
            name,
            lambda: AbstractValue.Make(default),
            show,
            prerequisites_of_calc=self._state_tickets,
        )

    def declare_vector_mirror(
        self, name: str, size: int, view: Callable[[Any], NDArray[np.float64]], initial: float
    ) -> None:
        """Declares discrete state, written in the same event as the abstract one, and its port.

        So a numeric part of the state can be logged, saved and compared as plain numbers.
        """
        values: Any = np.full(size, initial)
        index = self.DeclareDiscreteState(values)
        self._mirror = (int(index), view)
        self.DeclareStateOutputPort(name, index)

    def state(self, context: Context) -> Any:
        """Returns the frozen state."""
        return context.get_abstract_state(self._state_index).get_value()

    def step(self, context: Context, state: Any) -> Any:
        """Returns the next state; the same object when there is nothing to do.

        An ``EventStatus`` may be returned instead (``ReachedTermination`` ends the episode;
        never ``Failed``, which crashes the process).
        """
        raise NotImplementedError

    def _tick(self, context: Context, state: State) -> EventStatus:
        old = self.state(context)
        new = self.step(context, old)
        if isinstance(new, EventStatus):
            return new
        if new is old:
            return DID_NOTHING
        state.get_mutable_abstract_state(self._state_index).set_value(new)
        if self._mirror is not None:
            index, view = self._mirror
            vector: Any = state.get_mutable_discrete_state(index)
            vector.SetFromVector(view(new))
        return SUCCEEDED
