"""A headless Chromium, spoken to over two pipes: no driver, no port, no package."""

import contextlib
import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)

FLAGS = (
    *("--headless=new", "--no-sandbox", "--no-first-run", "--remote-debugging-pipe"),
    *("--disable-gpu", "--disable-dev-shm-usage", "--disable-background-networking"),
    *("--disable-component-update", "--disable-extensions"),
)

LONGEST_WAIT = 20.0
"""s, on a machine that others use as well."""


class Browser:
    """One tab. `events` are those of the protocol, such as messages of the console."""

    def __init__(self, ask: int, answers: int) -> None:
        self._ask, self._answers = ask, answers
        self._number = 0
        self._rest = b""
        self._session: str | None = None
        self._features: list[dict[str, str]] = []
        self.events: list[dict[str, Any]] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = attached["sessionId"]
        for part in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{part}.enable")

    def call(self, method: str, **given: object) -> Any:
        """Result of a command of the DevTools protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": given}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._ask, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, (method, answer)
                return answer["result"]
            self.events.append(answer)

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            part = os.read(self._answers, 1 << 16)
            assert part, "the browser has gone"
            self._rest += part
        text, _, self._rest = self._rest.partition(b"\0")
        found: dict[str, Any] = json.loads(text)
        return found

    def look(self, width: int, scheme: str = "light", height: int = 900) -> None:
        """Size of the window, and day or night."""
        size = {"width": width, "height": height, "screenWidth": width, "screenHeight": height}
        metrics = {**size, "deviceScaleFactor": 1, "mobile": width < 600}
        self.call("Emulation.setDeviceMetricsOverride", **metrics)
        self._features = [{"name": "prefers-color-scheme", "value": scheme}]
        self.print(False)

    def print(self, wanted: bool) -> None:
        """Show the page as it is printed, or as on a screen."""
        media = "print" if wanted else ""
        self.call("Emulation.setEmulatedMedia", media=media, features=self._features)

    def open(self, url: str) -> None:
        """Go to a page and wait for its text; a stream of events is never at its end."""
        self.call("Page.navigate", url=url)
        self.wait("location.href !== 'about:blank' && document.readyState !== 'loading'")

    def run(self, script: str) -> Any:
        """Value of an expression in the page; promises are waited for."""
        result = self.call(
            "Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def wait(self, script: str) -> None:
        """Until an expression is true."""
        until = time.monotonic() + LONGEST_WAIT
        while not self.run(script):
            assert time.monotonic() < until, (script, self.run("document.body.innerText"))
            time.sleep(0.05)

    def complaints(self) -> list[str]:
        """What console, log and policy said."""
        found = []
        for event in self.events:
            if event.get("method") in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled"):
                found.append(json.dumps(event["params"])[:300])
            if event.get("method") == "Log.entryAdded":
                found.append(event["params"]["entry"]["text"])
        return found

    def asked_for(self) -> set[str]:
        """Addresses of all requests."""
        return {
            event["params"]["request"]["url"]
            for event in self.events
            if event.get("method") == "Network.requestWillBeSent"
        }


@contextlib.contextmanager
def browser(folder: Path) -> Iterator[Browser]:
    """A browser with an empty profile."""
    assert CHROMIUM is not None
    (ask, hears), (says, answers) = os.pipe(), os.pipe()
    ask, hears = hears, ask  # os.pipe gives the reading end first
    # The browser reads from descriptor 3 and writes to 4.
    script = f'exec "$@" 3<&{hears} 4>&{answers}'
    process = subprocess.Popen(
        ["bash", "-c", script, "-", CHROMIUM, *FLAGS, f"--user-data-dir={folder}", "about:blank"],
        pass_fds=(hears, answers),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(hears)
    os.close(answers)
    try:
        yield Browser(ask, says)
    finally:
        os.close(ask)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(5)
        process.kill()
        process.wait()
        os.close(says)
