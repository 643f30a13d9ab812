"""A snapshot that is replaced whole, by one at a time, and who is told of it.

Two kinds of news: a *change* says that a part of the state is another now (read it again), an
*event* is a passing request that leaves no trace in the state.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from app.state.snapshot import (
    Change,
    Event,
    Snapshot,
)


class Store:
    """A snapshot that is replaced under a lock, and those who are told of it."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._snapshot = Snapshot()
        self._pending: list[Change] = []
        self._subscribers: list[Callable[[Change], None]] = []
        self._listeners: list[Callable[[Event], None]] = []

    def snapshot(self) -> Snapshot:
        """The state now."""
        return self._snapshot

    def subscribe(self, callback: Callable[[Change], None]) -> Callable[[], None]:
        """Be told of changes, from the thread that makes them: the callback must return fast.

        Returns:
            A function that ends the subscription.
        """
        return self._register(self._subscribers, callback)

    def subscribe_events(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Be told of events, from the thread that makes them: the callback must return fast."""
        return self._register(self._listeners, callback)

    def _register(self, registry: list[Any], callback: Any) -> Callable[[], None]:
        with self._lock:
            registry.append(callback)

        def end() -> None:
            with self._lock:
                if callback in registry:
                    registry.remove(callback)

        return end

    @contextmanager
    def _edit(self) -> Iterator[Snapshot]:
        """Hold the lock while the state is changed, and tell of it when the lock is free again.

        A subscriber may hold a lock of its own and come back here from another
        thread; telling under our lock would let the two wait for each other.
        """
        pending: list[Change] = []
        with self._lock:
            self._pending = pending
            yield self._snapshot
            subscribers = list(self._subscribers)
        for change in pending:
            for callback in subscribers:
                callback(change)

    def _put(self, change: Change, **values: Any) -> None:
        self._snapshot = replace(self._snapshot, version=self._snapshot.version + 1, **values)
        self._pending.append(change)

    def _tell(self, event: Event) -> None:
        with self._lock:
            listeners = list(self._listeners)
        for callback in listeners:
            callback(event)
