"""Open the source, sinks and displays of a watch, and what it saves in a journal or in files."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rulec_runtime.commands.destinations import console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits, state
from rulec_runtime.live.journal.lines import Files, LinesFile
from rulec_runtime.live.journal.outbox import Note, Outbox, Sink, spill_beside
from rulec_runtime.live.journal.refused import JournalRefused, JournalTrouble
from rulec_runtime.live.journal.sinks import HealthSink, MqttSink, WatchSink
from rulec_runtime.live.memory import Memory, nothing_yet
from rulec_runtime.live.moment import Present
from rulec_runtime.live.rows import Source
from rulec_runtime.live.sources.open import open_source
from rulec_runtime.live.sources.remarks import extra
from rulec_runtime.live.view.live_screen import LiveScreen
from rulec_runtime.output.open_file import bytes_of
from rulec_runtime.output.terminal import say_aside, styled
from rulec_runtime.recordings.recording import RecordingRefused

if TYPE_CHECKING:
    from rulec_runtime.live.journal.store import Journal


Acknowledge = Callable[[str, str], None]


@dataclass(frozen=True)
class Setup:
    """Everything that a watch uses, and its memory at the start."""

    memory: Memory
    source: Source
    present: Present
    screen: LiveScreen
    sinks: tuple[WatchSink, ...]


def set_up(
    options: argparse.Namespace, ruleset: Ruleset, stack: ExitStack, unwritten: list[str]
) -> Setup:
    """Open what the options name. `stack` closes it; `unwritten` then gets a message for what could
    not be written. Raises `Refusal` for mistakes of the user."""
    if options.state and options.journal:
        raise RecordingRefused("--journal keeps the state as well; leave out --state")
    folder = _waiting(options)
    journal = None
    if options.journal:
        journal = buffered_journal(options.journal, ruleset.plant, folder, stack, unwritten)
    waiting = folder or (None if journal is None else journal.folder)
    files, names = None, (options.events, options.state)
    if any(names):
        files = BufferedFiles(names, ruleset.plant, waiting, stack, unwritten)
    memory, position = _restored(ruleset, files, journal)
    own = None if files is None else files.folder
    sinks = sinks_of(options, ruleset, waiting or own, stack)
    map_path = Path(options.map) if options.map else None
    source: Source = open_source(options.source, ruleset, map_path, position or None)
    stack.callback(source.close)
    if files is not None:
        sinks.insert(0, files.sink)
    out = console(options)
    zone = ruleset.time_zone or ("UTC" if map_path else "")
    times = f", times in {zone}" if zone else ""
    what = f"watching {options.source} of plant {ruleset.plant}{times}; Ctrl-C ends"
    first = styled("[dim]{}[/]", what)
    out.print(first, soft_wrap=True)
    present = Present(ruleset, options.source, memory)
    acknowledge: Acknowledge = present.acknowledge
    if journal is not None:
        sinks.append(journal.sink)
        acknowledge = journal.joined_to(present)
    if options.page:
        url = _page(options.page, present, acknowledge, stack)
        out.print(styled("[dim]page: {}[/]", url))
    screen = stack.enter_context(LiveScreen(acknowledge, out, reported=memory.number))
    return Setup(memory, source, present, screen, tuple(sinks))


def _waiting(options: argparse.Namespace) -> Path | None:
    if options.waiting is not None and not Path(options.waiting).is_dir():
        raise RecordingRefused(f"--waiting {options.waiting}: there is no such folder")
    return Path(options.waiting) if options.waiting else None


def _restored(
    ruleset: Ruleset, files: BufferedFiles | None, journal: BufferedJournal | None
) -> tuple[Memory, Mapping[str, Any]]:
    """The latest saved memory, and the position of the source."""
    saved = [] if files is None else files.saved()
    if journal is not None and (stored := journal.saved()) is not None:
        saved.append(stored)
    found = [state.from_bytes(ruleset, *one) for one in saved]
    latest = max(found, key=lambda one: (one[0].number, one[0].count), default=None)
    return (nothing_yet(False), {}) if latest is None else latest


def _page(where: str, present: Present, acknowledge: Acknowledge, stack: ExitStack) -> str:
    """Serve the page at ``PORT`` of loopback or at ``HOST:PORT``; returns its address."""
    extra("starlette", "page")
    extra("uvicorn", "page")
    from rulec_runtime.live.view.page import serve

    host, port = host_and_port("--page", where)
    page = serve(present.now, host, port, os.environ.get("RULEC_TOKEN"), acknowledge)
    stack.callback(page.close)
    return page.url


CERTIFICATES = ("own.der", "own.pem", "trusted")
"""Of the device health server: its certificate, its key, and a folder of trusted certificates."""


def sinks_of(
    options: argparse.Namespace, ruleset: Ruleset, folder: Path | None, stack: ExitStack
) -> list[WatchSink]:
    """The sinks that the options name; `folder` is where events may wait."""
    sinks: list[WatchSink] = []
    if options.mqtt:
        sinks.append(_mqtt(options, ruleset.plant, folder, stack))
    elif options.mqtt_ca:
        raise JournalRefused("--mqtt-ca needs --mqtt URL")
    if options.device_health:
        sinks.append(_device_health(options, ruleset, stack))
    elif options.device_health_certificates:
        raise JournalRefused("--device-health-certificates needs --device-health [HOST:]PORT")
    return sinks


def _mqtt(
    options: argparse.Namespace, plant: str, folder: Path | None, stack: ExitStack
) -> WatchSink:
    extra("paho.mqtt.client", "mqtt")
    from rulec_runtime.live.journal.mqtt_out import MqttOut

    broker = MqttOut(
        options.mqtt,
        plant,
        user=os.environ.get("RULEC_MQTT_USER"),
        password=os.environ.get("RULEC_MQTT_PASSWORD"),
        authorities=options.mqtt_ca,
        say=say_aside,
    )
    stack.callback(broker.close)
    outbox = waiting_in(folder, "mqtt", broker, plant, stack, [])
    return MqttSink(broker, outbox, say_aside)


def _device_health(options: argparse.Namespace, ruleset: Ruleset, stack: ExitStack) -> WatchSink:
    """An OPC UA server at ``PORT`` of loopback or at ``HOST:PORT``."""
    extra("asyncua", "opcua")
    from rulec_runtime.live.journal.device_health import DeviceHealth, Security

    host, port = host_and_port("--device-health", options.device_health.removeprefix("opc.tcp://"))
    security = None
    if options.device_health_certificates:
        folder = Path(options.device_health_certificates)
        files = [folder / name for name in CERTIFICATES]
        for file in files:
            if not file.exists():
                raise JournalRefused(
                    f"{file}: there is no such file or folder; --device-health-certificates FOLDER "
                    f"holds {', '.join(CERTIFICATES[:2])} and the folder {CERTIFICATES[2]}"
                )
        security = Security(*files)
    server = DeviceHealth(ruleset.plant, tuple(ruleset.modules), port, host=host, security=security)
    stack.callback(server.close)
    return HealthSink(server)


def host_and_port(option: str, text: str) -> tuple[str, int]:
    """Host and port of ``PORT``, at loopback, or ``HOST:PORT``. Raises `JournalRefused`."""
    host, _, port = text.rstrip("/").rpartition(":")
    if not port.isdecimal() or int(port) > limits.LAST_PORT:
        raise JournalRefused(f"{option} {text[:60]}: write PORT or HOST:PORT, such as 8080")
    return host.strip("[]") or "127.0.0.1", int(port)


def waiting_in(
    folder: Path | None,
    name: str,
    sink: Sink,
    plant: str,
    stack: ExitStack,
    unwritten: list[str],
    noting: Callable[[Sequence[Note]], None] = lambda _: None,
    ahead: bool = False,
) -> Outbox:
    """The started outbox of a sink, which first writes what an earlier process has left in the
    folder; without a folder events wait in memory alone. The end of `stack` closes it."""
    file = None if folder is None else spill_beside(folder / name, plant)
    outbox = Outbox(sink, plant, say_aside, file=file, noting=noting, ahead=ahead)
    outbox.start()
    stack.callback(_close, outbox, unwritten)
    return outbox


def _close(outbox: Outbox, unwritten: list[str]) -> None:
    """Write what waits as far as possible; report what is left, also in `unwritten`."""
    if not outbox.close():
        return
    text = f"{outbox.address}: {outbox.summary()} could not be written"
    if outbox.file is not None and outbox.file.exists():
        text += f"; what waits stands in {outbox.file} and is written at the next start"
    else:
        text += ", nor kept elsewhere"
    say_aside(text)
    unwritten.append(text)


class BufferedJournal:
    """A journal with its outbox; `folder` holds what waits, None for memory alone."""

    def __init__(
        self,
        journal: Journal,
        name: str,
        plant: str,
        folder: Path | None,
        stack: ExitStack,
        unwritten: list[str],
    ) -> None:
        self._journal, self._plant = journal, plant
        self.folder = folder
        self._show_acknowledged: Callable[[frozenset[str]], None] = lambda _: None
        self.sink = waiting_in(folder, name, journal, plant, stack, unwritten, self.note)

    def saved(self) -> tuple[bytes, str] | None:
        """The latest state, from the journal or its outbox, and its address.

        Raises `JournalTrouble` if the database does not answer and nothing waits: it is unknown
        then which events were reported. A read-only database causes an error at the first write.
        """
        left = self.sink.left  # read first: what is written meanwhile is in the database
        with suppress(JournalTrouble):  # each commit holds the plant as well
            self._journal.take_lease(self._plant)
        try:
            stored = self._journal.state(self._plant)
        except JournalTrouble:
            if left is None and self._journal.is_there:
                raise
            stored = None
        if left is not None and (stored is None or stored.number < left[0]):
            return left[1], str(self.sink.file)
        return None if stored is None else (stored.state, self._journal.address)

    def note(self, notes: Sequence[Note]) -> None:
        """Write acknowledgements, and show those of everybody. Raises `JournalTrouble`."""
        for note in notes:
            try:
                self._journal.acknowledge(self._plant, note.episode, note.by, note.at)
            except JournalRefused as error:
                say_aside(str(error))
        self._show_acknowledged(self._journal.acknowledged(self._plant))

    def joined_to(self, present: Present) -> Callable[[str, str], None]:
        """Show earlier events and acknowledgements of the journal; returns a function that
        acknowledges, both in the journal and in `present`."""
        try:
            before = list(self._journal.events(self._plant, limit=limits.PAST))
        except JournalTrouble:
            before = []  # `rulec journal` lists its events when it is back
        present.recall([entry.event for entry in before])
        present.acknowledged(self.sink.noted)
        self._show_acknowledged = present.acknowledged
        with suppress(JournalTrouble):  # retried later; the outbox reports it
            self.note(())

        def acknowledge(episode: str, by: str) -> None:
            if episode not in present.now().acknowledged:
                self.sink.note(episode, by)
            present.acknowledge(episode, by)

        return acknowledge


def buffered_journal(
    where: str, plant: str, folder: Path | None, stack: ExitStack, unwritten: list[str]
) -> BufferedJournal:
    """Open a journal; the end of `stack` writes what waits, or adds a message to `unwritten`.

    Raises `JournalRefused` if it is not a journal, or another process watches the plant.
    """
    extra("sqlalchemy", "journal")
    from rulec_runtime.live.journal.store import open_journal

    journal = open_journal(where, patient=True)
    stack.callback(journal.close)
    name = "journal"
    if "://" not in journal.address:
        file = Path(journal.address)
        name, folder = file.name, folder or file.parent
    stack.callback(_released, journal, plant)
    return BufferedJournal(journal, name, plant, folder, stack, unwritten)


def _released(journal: Journal, plant: str) -> None:
    with suppress(JournalTrouble):  # the lease expires anyway
        journal.release(plant)


class BufferedFiles:
    """Files of events and of the state after them, with their outbox; `folder` holds what waits.

    The end of `stack` writes that, or adds a message to `unwritten`. Raises `JournalRefused` for a
    foreign file, or one in a folder that does not exist.
    """

    def __init__(
        self,
        names: tuple[str | None, str | None],
        plant: str,
        folder: Path | None,
        stack: ExitStack,
        unwritten: list[str],
    ) -> None:
        files = [Path(name) for name in names if name]
        for file in files:
            if not file.parent.is_dir():
                raise JournalRefused(f"{file}: there is no such folder")
        events, state = names
        lines = LinesFile(Path(events)) if events else None
        if lines is not None:
            stack.callback(lines.close)
        self.folder = folder or files[-1].parent
        self._state = Path(state) if state else None
        sink = Files(lines, self._state)
        name = files[0].name
        self.sink = waiting_in(self.folder, name, sink, plant, stack, unwritten, ahead=True)
        self._left = self.sink.left  # read first: what is written meanwhile is in the file
        last = 0 if lines is None else lines.last(plant)
        self.sink.written = max(last, self.sink.newest)

    def saved(self) -> list[tuple[bytes, str]]:
        """Saved states, each with its place; the one with the most events is the latest."""
        state, found = self._state, []
        if state is not None and state.exists():
            found.append((bytes_of(state, limits.LARGEST_STATE), str(state)))
        if state is not None and self._left is not None:
            found.append((self._left[1], str(self.sink.file)))
        return found
