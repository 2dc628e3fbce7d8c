"""A headless Chromium, driven over a pair of pipes (Chrome DevTools Protocol), to see a page as a person does."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from typing import Self

PROGRAM = shutil.which("chromium")
_OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage",
    "--remote-debugging-pipe",
)  # fmt: skip


class Browser:
    """One window of ``width`` by ``height`` pixels; a context manager."""

    def __init__(self, folder: Path, width: int = 1400, height: int = 900) -> None:
        self._folder, self._size = folder, (width, height)
        self._number = 0
        self._rest = b""
        self._session = ""
        #: What went wrong in the page: errors of its code and console, and what its policy or the network refused.
        self.problems: list[str] = []

    def __enter__(self) -> Self:
        read_there, self._out = os.pipe()
        self._in, write_there = os.pipe()
        # the protocol has numbers 3 and 4 for the two
        program = f'exec "$@" 3<&{read_there} 4>&{write_there}'
        self._process = subprocess.Popen(
            ["bash", "-c", program, "-", PROGRAM, *_OPTIONS, f"--user-data-dir={self._folder}",
             "--window-size={},{}".format(*self._size)],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, pass_fds=(read_there, write_there),
        )  # fmt: skip
        os.close(read_there)
        os.close(write_there)
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        width, height = self._size
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._out)
        try:
            self._process.terminate()
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait(10)
        os.close(self._in)

    def _call(self, method: str, **parameters: object) -> dict:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + 60
        while True:
            while b"\0" not in self._rest:
                ready, _, _ = select.select([self._in], [], [], max(0.0, end - time.monotonic()))
                assert ready, f"{method}: no answer from the browser"
                chunk = os.read(self._in, 1 << 20)
                assert chunk, f"{method}: the browser has gone"
                self._rest += chunk
            text, _, self._rest = self._rest.partition(b"\0")
            answer = json.loads(text)
            self._note(answer)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]

    def _note(self, message: dict) -> None:
        found = message.get("params", {})
        match message.get("method"):
            case "Runtime.exceptionThrown":
                details = found["exceptionDetails"]
                self.problems.append(details.get("exception", {}).get("description") or details["text"])
            case "Runtime.consoleAPICalled" if found["type"] in {"error", "warning", "assert"}:
                self.problems.append(" ".join(str(one.get("value", one.get("description"))) for one in found["args"]))
            case "Log.entryAdded" if found["entry"]["level"] in {"error", "warning"}:
                self.problems.append(f"{found['entry']['text']} {found['entry'].get('url', '')}")

    def resize(self, width: int, height: int) -> None:
        self._call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def scheme(self, wanted: str) -> None:
        """``light`` or ``dark``, as a person's desktop asks for it."""
        features = [{"name": "prefers-color-scheme", "value": wanted}]
        self._call("Emulation.setEmulatedMedia", features=features)

    def key(self, text: str) -> None:
        """A key is pressed and released: a letter, or one by its name such as Escape or Enter."""
        typed = {"text": text} if len(text) == 1 else {"text": "\r"} if text == "Enter" else {}
        for kind in ("keyDown", "keyUp"):
            self._call("Input.dispatchKeyEvent", type=kind, key=text, **(typed if kind == "keyDown" else {}))

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """The mouse is pressed at one place of the window, moved, and released at another."""
        steps = (
            ("mouseMoved", begin, 0),
            ("mousePressed", begin, 1),
            ("mouseMoved", end, 1),
            ("mouseReleased", end, 0),
        )
        for kind, (x, y), buttons in steps:
            button = "none" if kind == "mouseMoved" and not buttons else "left"
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, buttons=buttons, clickCount=1)

    def open(self, url: str) -> None:
        self._call("Page.navigate", url=url)

    def ask(self, expression: str) -> object:
        """The value of an expression in the page."""
        found = self._call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, found["exceptionDetails"]
        return found["result"].get("value")

    def until(self, expression: str, seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not self.ask(expression):
            assert time.monotonic() < end, f"never true: {expression}"
            time.sleep(0.05)

    def picture(self, file: Path, *, whole: bool = True) -> None:
        """Of the whole page, or of the window."""
        data = self._call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        file.write_bytes(base64.b64decode(data))
