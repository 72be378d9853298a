# SPDX-License-Identifier: Apache-2.0
"""A browser for the tests of pages."""
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

CHROMIUM = next((found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None)


class Browser:
    """A headless Chromium, driven over a pipe by its DevTools protocol."""

    def __init__(self):
        self.profile = tempfile.TemporaryDirectory(prefix="egosgm_chromium_")
        from_us, self.to_browser = os.pipe()
        self.from_browser, to_us = os.pipe()
        command = (f"exec '{CHROMIUM}' --headless --no-sandbox --disable-gpu --disable-dev-shm-usage --no-first-run --remote-debugging-pipe "
                   f"--window-size=1280,1600 --user-data-dir='{self.profile.name}' about:blank 3<&{from_us} 4>&{to_us}")
        self.process = subprocess.Popen(["bash", "-c", command], pass_fds=[from_us, to_us], stderr=subprocess.DEVNULL)
        os.close(from_us), os.close(to_us)
        self.number, self.rest, self.events, self.session = 0, b"", [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Log", "Page", "Network"):
            self.call(domain + ".enable")

    def close(self):
        self.process.terminate()
        self.process.wait(timeout=900)
        os.close(self.to_browser), os.close(self.from_browser)
        try:
            self.profile.cleanup()
        except OSError:  # a process of the browser that is still leaving
            shutil.rmtree(self.profile.name, ignore_errors=True)

    def receive(self):
        while b"\0" not in self.rest:
            part = os.read(self.from_browser, 1 << 16)
            if not part:
                raise RuntimeError("Chromium has gone")
            self.rest += part
        message, self.rest = self.rest.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.to_browser, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(answer["error"])
                return answer["result"]
            self.events.append(answer)

    def open(self, file):
        self.call("Page.navigate", url=pathlib.Path(file).as_uri())
        while not any(event["method"] == "Page.loadEventFired" for event in self.events):
            self.events.append(self.receive())

    def evaluate(self, expression):
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(answer["exceptionDetails"])
        return answer["result"].get("value")

    def errors(self):
        return [event for event in self.events if event["method"] == "Runtime.exceptionThrown"
                or (event["method"] == "Runtime.consoleAPICalled" and event["params"]["type"] in ("error", "warning", "assert"))
                or (event["method"] == "Log.entryAdded" and event["params"]["entry"]["level"] in ("error", "warning"))]

    def requests(self):
        return [event["params"]["request"]["url"] for event in self.events if event["method"] == "Network.requestWillBeSent"]

    def mouse(self, kind, x, y, buttons=1):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=buttons, clickCount=1)
