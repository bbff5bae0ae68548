#!/usr/bin/env python3
"""Opens a report page in headless Chromium at the sizes of a phone and a desktop, and checks it.

  look_at_report.py REPORT.html [--shots FOLDER] [--chromium PROGRAM]

Checked at each width: nothing on the console, nothing asked of the network (films beside the page are files), no
scrolling sideways, every picture decoded, every chart visible, the slider cuts the picture where it is pulled to; and
without JavaScript the charts are visible, too.
--shots keeps pictures of the whole page. Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import argparse
import base64
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from urllib.parse import urlparse
from urllib.request import pathname2url

SIZES = {"phone": (390, 844), "desktop": (1280, 900)}
NO_CHROMIUM = 77  # ctest reports "skipped"
TIMEOUT_S = 60  # for any answer


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
                time.sleep(0.01)
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


class Page:
    """A file, or an address that begins with http://, in one tab of one size."""

    def __init__(self, browser, path, size, script=True):
        self.browser, self.path = browser, path
        browser.events = []
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.target = target
        self.session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Log", "Network"]:
            self.call(domain + ".enable")
        self.call("Emulation.setDeviceMetricsOverride", width=size[0], height=size[1], deviceScaleFactor=1,
                  mobile=size[0] < 600)
        if not script:
            self.call("Emulation.setScriptExecutionDisabled", value=True)
        served = path.startswith("http://")
        self.call("Page.navigate", url=path if served else "file://" + pathname2url(os.path.abspath(path)))
        browser.wait_for("Page.loadEventFired")

    def call(self, method, **parameters):
        return self.browser.call(method, session=self.session, **parameters)

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


def check_slider(page):
    """Moves the first slider to a quarter and to three quarters of its picture."""
    box = page.value("(function(){var c=document.querySelector('.compare input');if(!c)return null;"
                     "c.scrollIntoView({block:'center'});var r=c.getBoundingClientRect();"
                     "return [r.left,r.top,r.width,r.height]})()")
    if box is None:
        return []
    cuts = []
    for fraction in (0.25, 0.75):
        page.click(box[0] + fraction * box[2], box[1] + box[3] / 2)
        cuts.append(page.value("parseFloat(document.querySelector('.compare').style.getPropertyValue('--cut'))"))
        shown = page.value("getComputedStyle(document.querySelector('.compare figure+figure')).clipPath")
        if "%" not in (shown or ""):
            return ["the slider clips nothing: clip-path is " + str(shown)]
    good = all(cut is not None and abs(cut - want) < 6 for cut, want in zip(cuts, (25, 75)))
    return [] if good else [f"the slider is at {cuts} after clicks at 25 and 75 percent"]


def check_page(page, width):
    found = page.complaints()
    wide = page.value("document.documentElement.scrollWidth")
    if wide > width:
        culprit = page.value("(function(){var w=document.documentElement.clientWidth,n='';"
                             "document.querySelectorAll('main *').forEach(function(e){if(!n&&!e.closest('.scroll')&&"
                             "e.getBoundingClientRect().right>w+1)n=e.outerHTML.slice(0,120)});return n})()")
        found.append(f"scrolls sideways: {wide} pixels wide at {width}, by {culprit}")
    # Hostile names on test pages set the title if they are executed.
    if page.value("document.title") == "run":
        found.append("a name on the page was executed as a script")
    # Pictures that load lazily are loaded now.
    broken = page.value("(async function(){var n=0;for(var i of document.images){i.loading='eager';"
                        "try{await i.decode()}catch(e){n++}}return n})()")
    if broken:
        found.append(f"{broken} pictures do not decode")
    hidden = page.value("[].filter.call(document.querySelectorAll('.plot svg'),function(s){"
                        "var d=s.getBoundingClientRect();return d.width<100||d.height<50}).length")
    if hidden:
        found.append(f"{hidden} charts are not visible")
    return found + check_slider(page) + [c for c in page.complaints() if c not in found]


def check_without_script(page):
    found = page.complaints()
    shown = page.value("[].every.call(document.querySelectorAll('.plot svg'),function(s){"
                       "return s.getBoundingClientRect().height>50})")
    if not shown:
        found.append("without JavaScript a chart is not visible")
    return found


def check_report(browser, arguments):
    found = []
    for name, size in SIZES.items():
        page = Page(browser, arguments.report, size)
        found += [name + ": " + complaint for complaint in check_page(page, size[0])]
        if arguments.shots:
            page.shot(os.path.join(arguments.shots, name + ".png"))
        page.close()
    page = Page(browser, arguments.report, SIZES["phone"], script=False)
    found += ["no script: " + complaint for complaint in check_without_script(page)]
    if arguments.shots:
        page.shot(os.path.join(arguments.shots, "no_script.png"))
    page.close()
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", help="the report page")
    parser.add_argument("--shots", help="folder for screenshots of the page")
    parser.add_argument("--chromium", default=shutil.which("chromium") or shutil.which("chromium-browser"))
    arguments = parser.parse_args()
    if not arguments.chromium:
        print("skipped: Chromium is not installed (Debian package chromium)")
        return NO_CHROMIUM
    if not os.path.isfile(arguments.report):
        parser.error(arguments.report + " is not a file")
    if arguments.shots:
        os.makedirs(arguments.shots, exist_ok=True)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(arguments.chromium, profile)
        try:
            found = check_report(browser, arguments)
        finally:
            browser.close()
    for complaint in found:
        print(complaint)
    print(f"look_at_report: {len(found)} findings")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
