"""What a page asks for."""

from __future__ import annotations

import asyncio
import json
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Literal

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import Field, TypeAdapter, ValidationError

from app.messages import GivenPath, Model
from app.state.scores import Scored
from app.state.snapshot import Change, Command, Event, Notice, Snapshot, StudyNews
from app.state.workbench import Workbench
from app.web import results, steps


class OpenRequest(Model):
    """Open another sequence."""

    name: GivenPath
    """A built-in name, a name of the list, or a folder."""


class TrailChanges(Model):
    """How trails are drawn, in 3D and in pictures."""

    seconds: float | None = Field(None, ge=0.5, le=600.0)
    """How far back they go."""
    fades: bool | None = None
    """Whether they are fainter the older they are."""


class CurveRequest(Model):
    """Compute what some parameters would change."""

    keys: list[str] = Field(max_length=40)


class LayerChanges(Model):
    """Layers of the 3D view, by name."""

    changes: dict[str, bool]


class ViewChange(Model):
    """Look through a camera in 3D."""

    camera: int | Literal["top"] | None
    """Its index; null for the free view."""


class ThemeChange(Model):
    """Have the 3D view dark or light."""

    theme: Literal["dark", "light"]


class SelectChange(Model):
    """Select a track."""

    id: int | None


class SeekChange(Model):
    """Move the playhead."""

    step: int
    origin: str = Field("", max_length=100)


class StreamSeek(SeekChange):
    """From the page over the socket."""

    type: Literal["seek"]


class StreamSelect(SelectChange):
    """From the page over the socket."""

    type: Literal["select"]


class StreamMotion(Model):
    """From the page over the socket: whether its browser asks for reduced motion."""

    type: Literal["motion"]
    flies: bool
    """Whether the 3D view may animate a change of viewpoint; false for reduced motion."""


class StreamPing(Model):
    """From the page over the socket: asks for a ``pong``, which shows that the server answers."""

    type: Literal["ping"]


SECONDS_BETWEEN = {"progress": 0.1, "tasks": 0.25, "timeline": 0.25}
"""How often at most a page is told how far the run and other work is, and that the timeline has
grown."""

LARGEST_MESSAGE = 1 << 14
"""Characters of a page's message."""

BACK_SECONDS = 30.0
"""So long pages come back to a server that was started again; at least one is told why it was."""

KEPT_STEPS = 64
MOST_NOTICES = 20

router = APIRouter()

FromPage = TypeAdapter[StreamSeek | StreamSelect | StreamMotion | StreamPing](
    StreamSeek | StreamSelect | StreamMotion | StreamPing
)


class _Page:
    """What has not been sent to one page yet."""

    def __init__(self) -> None:
        self.news: set[Change] = {"sequence", "playhead", "tasks"}
        self.flies = True
        self.messages: list[str] = []
        self.wake = asyncio.Event()
        self.wake.set()
        self.sent_step: tuple[Any, ...] = ()
        self.sent_timeline: tuple[str, str, int, int] = ("", "", 0, 0)
        self.sent_evaluation: Scored | None = None
        self.due: set[str] = set()
        """Kinds of message that are held back for a moment."""
        self.sent_at = dict.fromkeys(SECONDS_BETWEEN, 0.0)
        self.timer: asyncio.TimerHandle | None = None


class Stream:
    """All pages. Lives on the event loop; news come from any thread."""

    def __init__(self, workbench: Workbench) -> None:
        self._workbench = workbench
        self._pages: set[_Page] = set()
        self._unheard: Notice | None = None
        """What was said last while there was no page, for the first that comes."""
        self._before: Notice | None = None
        self._begun = 0.0
        self._state: tuple[int, str] = (-1, "")
        self._steps: OrderedDict[tuple[Any, ...], str] = OrderedDict()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ends: list[Callable[[], None]] = []

    def start(self, before: Notice | None = None) -> None:
        """Called on the event loop that serves.

        Args:
            before: What all pages that come back are told of the start before.
        """
        self._before, self._begun = before, time.monotonic()
        loop = self._loop = asyncio.get_running_loop()

        def on_change(change: Change) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(self._note, change)

        def on_event(event: Event) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(self._pass_on, event)

        self._ends = [
            self._workbench.subscribe(on_change),
            self._workbench.subscribe_events(on_event),
        ]

    def stop(self) -> None:
        """Hear no more news."""
        for end in self._ends:
            end()

    def _note(self, change: Change) -> None:
        if change == "sequence" and self._unheard is not None and self._unheard.level == "error":
            self._unheard = None  # what went wrong before it was opened is over
        for page in self._pages:
            page.news.add(change)
            page.wake.set()

    def _pass_on(self, event: Event) -> None:
        match event:
            case Command(name):
                text = json.dumps({"type": "command", "name": name})
            case StudyNews():
                text = _study(event)
            case Notice():
                text = _notice(event)
                if not self._pages:
                    self._unheard = event
        for page in self._pages:
            page.messages = [*page.messages, text][-MOST_NOTICES:]
            page.wake.set()

    async def serve(self, socket: WebSocket) -> None:
        """One page, until it goes."""
        await socket.accept()
        page = _Page()
        if self._unheard is not None:
            page.messages.append(_notice(self._unheard))
        self._unheard = None
        if self._before is not None:
            page.messages.append(_notice(self._before))
            if time.monotonic() - self._begun > BACK_SECONDS:
                self._before = None
        page.messages += [_study(news) for news in self._workbench.running_studies]
        self._pages.add(page)
        sender = asyncio.create_task(self._send(socket, page))
        try:
            while (message := await socket.receive())["type"] == "websocket.receive":
                self._hear(page, message.get("text"))
        except WebSocketDisconnect:
            pass
        finally:
            self._pages.discard(page)
            self._set_flies()
            if page.timer is not None:
                page.timer.cancel()
            sender.cancel()
            await asyncio.gather(sender, return_exceptions=True)

    def _hear(self, page: _Page, text: str | None) -> None:
        try:
            if text is None or len(text) > LARGEST_MESSAGE:
                raise ValueError(f"expected at most {LARGEST_MESSAGE} characters of text")
            wish = FromPage.validate_json(text)
        except ValueError as error:
            words = str(error)
            if isinstance(error, ValidationError):
                words = "expected seek, select, motion or ping with their fields"
            page.messages = [*page.messages, _notice(Notice("warn", words))][-MOST_NOTICES:]
            page.wake.set()
            return
        match wish:
            case StreamSeek():
                self._workbench.seek(wish.step, wish.origin)
            case StreamSelect():
                self._workbench.select(wish.id)
            case StreamMotion():
                page.flies = wish.flies
                self._set_flies()
            case StreamPing():
                page.messages = [*page.messages, '{"type":"pong"}'][-MOST_NOTICES:]
                page.wake.set()

    def _set_flies(self) -> None:
        """Animate the 3D view only if no page asks for reduced motion.

        A click inside viser does not tell which page it came from, so one answer is for all.
        """
        self._workbench.set_flies(all(page.flies for page in self._pages))

    async def _send(self, socket: WebSocket, page: _Page) -> None:
        while True:
            await page.wake.wait()
            page.wake.clear()
            messages, page.messages = page.messages, []
            for text in messages:
                await socket.send_text(text)
            news, page.news = page.news, set()
            snapshot = self._workbench.snapshot()
            if "playhead" in news:  # first: the page then asks for the picture at once
                origin = snapshot.playhead_origin
                message = {"type": "playhead", "step": snapshot.playhead, "origin": origin}
                await socket.send_text(json.dumps(message))
            if news - {"playhead", "progress", "evaluation", "tasks"}:
                await socket.send_text(self._state_text(snapshot))
            await self._send_step(socket, page, snapshot)
            await self._send_evaluation(socket, page, snapshot)
            await self._send_progress(socket, page, news, snapshot)

    async def _send_step(self, socket: WebSocket, page: _Page, snapshot: Snapshot) -> None:
        sequence, run, step = snapshot.sequence, snapshot.run, snapshot.playhead
        if sequence is None:
            return
        computed = snapshot.step_is_computed
        shown = (run.key, run.revision) if run is not None else ("", 0)
        key = (snapshot.sequence_key, *shown, step, computed)
        if key == page.sent_step:
            return
        text = self._steps.get(key)
        if text is None:
            message = steps.step_of(sequence, run, step)
            text = _with_type("step", message)
            sent = (message.computed, message.revision)
            if sent == (computed, shown[1]):  # else it was computed this very moment
                self._steps[key] = text
                while len(self._steps) > KEPT_STEPS:
                    self._steps.popitem(last=False)
        page.sent_step = key
        await socket.send_text(text)

    async def _send_evaluation(self, socket: WebSocket, page: _Page, snapshot: Snapshot) -> None:
        scored = snapshot.scores.shown
        if scored is not None and scored is not page.sent_evaluation:
            message = {
                "type": "evaluation",
                "run": scored.key,
                "steps": scored.steps,
                "partial": not scored.final,
            }
            await socket.send_text(json.dumps(message))
        page.sent_evaluation = scored

    async def _send_progress(
        self, socket: WebSocket, page: _Page, news: set[Change], snapshot: Snapshot
    ) -> None:
        assert self._loop is not None
        if "progress" in news:
            page.due |= {"progress", "timeline"}
        if news & {"run", "sequence"}:
            page.due = {"timeline", *page.due} - {"progress"}  # how far the run is, the state said
            page.sent_at["timeline"] = 0.0
        if "tasks" in news:
            page.due.add("tasks")
        shown = _shown(snapshot)
        if shown == page.sent_timeline:
            page.due.discard("timeline")
        now = self._loop.time()
        for kind in sorted(page.due):
            if now - page.sent_at[kind] >= SECONDS_BETWEEN[kind]:
                page.sent_at[kind] = now
                page.due.discard(kind)
                message: dict[str, Any]
                if kind == "timeline":
                    page.sent_timeline = shown
                    message = {"run": shown[1], "done": shown[2], "revision": shown[3]}
                elif kind == "tasks":
                    message = {
                        "tasks": {name: one.model_dump() for name, one in snapshot.tasks.items()}
                    }
                else:
                    message = {"run": results.run_of(snapshot).model_dump(mode="json")}
                await socket.send_text(json.dumps({"type": kind, **message}))
        if page.due and page.timer is None:
            when = min(page.sent_at[kind] + SECONDS_BETWEEN[kind] for kind in page.due)
            page.timer = self._loop.call_at(when, _remind, page)

    def _state_text(self, snapshot: Snapshot) -> str:
        if self._state[0] != snapshot.version:
            state = results.state_of(snapshot).model_dump_json()
            self._state = (snapshot.version, f'{{"type":"state","state":{state}}}')
        return self._state[1]


def _study(news: StudyNews) -> str:
    return json.dumps({"type": "study", "study": news.told})


def _notice(notice: Notice) -> str:
    message = {"type": "notice", **asdict(notice)}
    if notice.report is None:
        del message["report"]
    return json.dumps(message)


def _remind(page: _Page) -> None:
    page.timer = None
    page.wake.set()


def _shown(snapshot: Snapshot) -> tuple[str, str, int, int]:
    """What a timeline shows: of another sequence, run, length or revision, it is another."""
    run = snapshot.run
    if run is None:
        return snapshot.sequence_key, "", 0, 0
    return snapshot.sequence_key, run.key, run.done, run.revision


def _with_type(kind: str, message: Model) -> str:
    return f'{{"type":"{kind}",{message.model_dump_json()[1:]}'


@router.websocket("/api/stream")
async def _stream(socket: WebSocket) -> None:
    stream: Stream = socket.app.state.stream
    await stream.serve(socket)
