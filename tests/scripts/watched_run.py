"""Runs regrade, follows its events and can kill it at any of them; a module of crash_recovery.py."""

import json
import os
import signal
import subprocess
import threading


def reset_signals():
    """A background process ignores SIGINT, and children would inherit that."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


class Run:
    """A started regrade whose events a thread reads."""

    def __init__(self, command, group=True):
        self.group, self.stage, self.ended, self.began, self.finished_before = group, None, [], [], []
        self.changed = threading.Condition()
        self.child = subprocess.Popen(command + ["--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                                      stdin=subprocess.DEVNULL, start_new_session=True, preexec_fn=reset_signals)
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()

    def read(self):
        for line in self.child.stdout:
            try:
                event = json.loads(line)
            except ValueError:
                continue
            with self.changed:
                if event.get("event") == "stage_begin":
                    self.stage = event["stage"]
                    self.began.append(self.stage)
                elif event.get("event") == "stage_end":
                    self.ended.append(event["stage"])
                    self.stage = None
                self.changed.notify_all()

    def wait_for(self, stage):
        """True once `stage` has begun; False if the run ended before."""
        while self.child.poll() is None:
            with self.changed:
                if stage in self.began:
                    return True
                self.changed.wait(0.05)
        return stage in self.began

    def finish(self):
        status = self.child.wait(timeout=600)
        self.reader.join()
        return status

    def kill(self, number):
        """Returns the exit status; None if the program did not end within 60 s."""
        try:
            if self.group and number == signal.SIGKILL:
                os.killpg(self.child.pid, number)
            else:
                self.child.send_signal(number)
            status = self.child.wait(timeout=60)
        except ProcessLookupError:
            status = self.child.wait()
        except subprocess.TimeoutExpired:
            os.killpg(self.child.pid, signal.SIGKILL)
            return None
        self.reader.join(timeout=5)  # COLMAP may still hold the pipe
        return status
