"""Headless Chromium for tests of pages: over two pipes, without a package (Chrome DevTools Protocol)."""

import argparse
import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from urllib.parse import urlparse
from urllib.request import pathname2url

SIZES = {"phone": (390, 844), "desktop": (1280, 900)}
# ctest reports "skipped"; a failure where a browser is required.
NO_CHROMIUM = 1 if os.environ.get("REGRADE_REQUIRE_BROWSER") == "1" else 77
TIMEOUT_S = 300  # for any answer
WAIT_S = 120  # for a page to do something
# Pixels of a scene page's canvas for each pixel of the window's sides, where what is checked does not depend on them: without
# a graphics processor they are most of the work.
FEW_PIXELS = 0.25


class Browser:
    """Chromium controlled over two pipes; messages are JSON and end with a zero byte."""

    def __init__(self, program, profile):
        to_browser, self.send_fd = os.pipe()
        self.read_fd, from_browser = os.pipe()

        def connect():
            # The browser expects descriptors 3 and 4; the pipes may already have these numbers, swapped.
            read, write = os.dup(to_browser), os.dup(from_browser)
            os.dup2(read, 3)
            os.dup2(write, 4)
            os.set_inheritable(3, True)
            os.set_inheritable(4, True)

        self.process = subprocess.Popen(
            [program, "--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--no-first-run",
             "--disable-background-networking", "--mute-audio", "--user-data-dir=" + profile, "--remote-debugging-pipe",
             "about:blank"],
            preexec_fn=connect, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        os.set_blocking(self.read_fd, False)
        self.buffer, self.number, self.events = b"", 0, []

    def _message(self, deadline):
        while b"\0" not in self.buffer:
            if time.monotonic() > deadline or self.process.poll() is not None:
                raise RuntimeError("Chromium does not answer")
            try:
                piece = os.read(self.read_fd, 1 << 20)
            except BlockingIOError:
                select.select([self.read_fd], [], [], 0.1)
                continue
            if not piece:
                raise RuntimeError("Chromium has ended")
            self.buffer += piece
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, session=None, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.send_fd, data):]
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            answer = self._message(deadline)
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(method + ": " + answer["error"]["message"])
                return answer["result"]
            self.events.append(answer)

    def wait_for(self, method):
        deadline = time.monotonic() + TIMEOUT_S
        while not any(event.get("method") == method for event in self.events):
            self.events.append(self._message(deadline))

    def close(self):
        try:
            self.call("Browser.close")
        except (RuntimeError, OSError):
            pass
        try:
            self.process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def new_person(browser):
    """Somebody who was never on a page: a storage of their own."""
    return browser.call("Target.createBrowserContext")["browserContextId"]


class Page:
    """A file, or an address that begins with http://, in one tab of one size.

    Pages of one `person` (from new_person) share what a browser stores; None: the browser's own. `before` is a script that
    runs before those of the page. `scale` is the page's device pixel ratio.
    """

    def __init__(self, browser, path, size, script=True, person=None, before=None, scale=1):
        self.browser, self.path = browser, path
        browser.events = []
        of_person = {"browserContextId": person} if person else {}
        target = browser.call("Target.createTarget", url="about:blank", **of_person)["targetId"]
        self.target = target
        self.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Log", "Network"]:
            self.call(domain + ".enable")
        self.set_window(size, scale)
        if not script:
            self.call("Emulation.setScriptExecutionDisabled", value=True)
        if before:
            self.call("Page.addScriptToEvaluateOnNewDocument", source=before)
        served = path.startswith("http://")
        self.call("Page.navigate", url=path if served else "file://" + pathname2url(os.path.abspath(path)))
        browser.wait_for("Page.loadEventFired")

    def call(self, method, **parameters):
        return self.browser.call(method, session=self.session, **parameters)

    def set_window(self, size, scale):
        self.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=scale,
                  mobile=size[0] < 600)

    def reload(self):
        self.browser.events = []
        self.call("Page.reload")
        self.browser.wait_for("Page.loadEventFired")

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(result["exceptionDetails"]["text"] + " in " + expression)
        return result["result"].get("value")

    def click(self, x, y):
        for kind in ["mousePressed", "mouseReleased"]:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def shot(self, file):
        picture = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=True)["data"]
        with open(file, "wb") as out:
            out.write(base64.b64decode(picture))

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)

    def complaints(self):
        """Messages on the console and network requests of the page."""
        found, folder = [], os.path.dirname(os.path.abspath(self.path))
        for event in self.browser.events:
            about, method = event.get("params", {}), event.get("method")
            if method == "Runtime.exceptionThrown":
                found.append("exception: " + about["exceptionDetails"].get("exception", {}).get("description", "?"))
            elif method == "Runtime.consoleAPICalled" and about["type"] in ("error", "warning", "assert"):
                found.append("console: " + str(about["args"]))
            elif method == "Log.entryAdded" and about["entry"]["level"] in ("error", "warning"):
                found.append("log: " + about["entry"]["text"] + " " + about["entry"].get("url", ""))
            elif method == "Network.requestWillBeSent":
                address = urlparse(about["request"]["url"])
                in_folder = address.scheme == "file" and os.path.dirname(address.path) == pathname2url(folder)
                own = self.path.startswith("http://") and address.netloc == urlparse(self.path).netloc
                if address.scheme not in ("data", "about", "blob") and not in_folder and not own:
                    found.append("requests " + about["request"]["url"][:200])
        return found


def wait_until(page, expression, seconds=WAIT_S):
    end = time.monotonic() + seconds
    while not page.value(expression):
        if time.monotonic() > end:
            raise RuntimeError("waited in vain for " + expression)
        time.sleep(0.03)


def open_page(browser, path, size, before=None, scale=1, seconds=600):
    """The page once its whole scene is there."""
    page = Page(browser, path, size, before=before, scale=scale)
    wait_until(page, "!!globalThis.regradePage && (!!regradePage.picture || /cannot/.test(message.textContent))", seconds)
    return page


def complaints(page):
    # Reading pixels back is slow on purpose here.
    return [c for c in page.complaints() if "GPU stall due to ReadPixels" not in c]


def parser_of(doc, shots=True):
    """A parser for a script with this text; --chromium, and --shots for a folder of screenshots."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    if shots:
        parser.add_argument("--shots", help="folder for screenshots")
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    return parser


def parsed(parser):
    """The arguments; ends the script where there is no Chromium."""
    arguments = parser.parse_args()
    if not arguments.chromium:
        print("Chromium is not installed (Debian package chromium)")
        sys.exit(NO_CHROMIUM)
    if getattr(arguments, "shots", None):
        os.makedirs(arguments.shots, exist_ok=True)
    return arguments


@contextlib.contextmanager
def running(chromium):
    """A browser with a profile of its own, closed at the end."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(chromium, profile)
        try:
            yield browser
        finally:
            browser.close()


def status_of(name, found):
    """Prints the findings; the exit status."""
    for complaint in found:
        print(complaint)
    print(f"{name}: {len(found)} findings")
    return 1 if found else 0
