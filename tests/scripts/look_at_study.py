#!/usr/bin/env python3
"""Makes a study with `regrade study`, answers it in headless Chromium, and analyses the saved answers.

  look_at_study.py REGRADE [--shots FOLDER] [--chromium PROGRAM]

Participants prefer one method; one of them ignores the attention checks. Checked: nothing on the console or asked of the
network, no scrolling sideways and every film within the window at the sizes of a phone and a desktop, no name of a method
on the page, films that play, places that are counterbalanced, a reload that goes on, keys that choose, and the analysis.
Exit status 1 if anything is wrong, 77 if there is no Chromium or ffmpeg.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile

from browser import NO_CHROMIUM, SIZES, Page, complaints, new_person, parsed, parser_of, running, status_of, wait_until

CLIPS = ("fern", "horns", "trex", "room")
METHODS = ("plain", "lovely", "dull")
CHECKS = 2
PAIRS = len(CLIPS) * 3
STATE = "(history.state || {answers: []})"


def make_films(folder):
    colours = {"plain": "gray", "lovely": "orange", "dull": "black"}
    for method in METHODS:
        os.makedirs(os.path.join(folder, method))
        for i, clip in enumerate(CLIPS):
            subprocess.run(["ffmpeg", "-v", "error", "-f", "lavfi", "-i",
                            f"color={colours[method]}:s={160 + 16 * i}x96:d=1:r=10", "-c:v", "libvpx", "-b:v", "50k",
                            os.path.join(folder, method, clip + ".webm")], check=True)


def program(*words):
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    return done.returncode, done.stdout


def ready(page):
    wait_until(page, "!document.getElementById('end').hidden || "
                     "[...document.querySelectorAll('#films button')].some((b) => !b.disabled)")


def brightness(page):
    """Of each film shown, from its own picture: a participant sees no more."""
    return page.value("[...document.querySelectorAll('video')].map((v) => { const c = document.createElement('canvas');"
                      "c.width = c.height = 1; const g = c.getContext('2d'); g.drawImage(v, 0, 0, 1, 1);"
                      "return g.getImageData(0, 0, 1, 1).data[0] })")


def choose(page, place, key):
    if key:
        page.call("Input.dispatchKeyEvent", type="keyDown", key=str(place + 1), text=str(place + 1))
        page.call("Input.dispatchKeyEvent", type="keyUp", key=str(place + 1))
    else:
        page.value(f"document.querySelectorAll('#films button')[{place}].click()")


def layout(page, size):
    found = []
    wide = page.value("document.documentElement.scrollWidth")
    if wide > size[0]:
        found.append(f"scrolls sideways: {wide} pixels wide at {size[0]}")
    outside = page.value("[...document.querySelectorAll('.film video,.film button')].filter((e) => { const r = "
                         "e.getBoundingClientRect(); return r.width < 40 || r.bottom > innerHeight || r.right > innerWidth + 1 "
                         "}).length")
    if outside:
        found.append(f"{outside} films or buttons are outside the window")
    text = page.value("document.querySelector('main').innerText")
    if any(method in text for method in METHODS):
        found.append("a method's name is on the page: " + text)
    return found


def take_part(browser, path, size, careful, shot=None):
    """(answers of one participant, complaints)"""
    found = []
    page = Page(browser, path, size, person=new_person(browser))
    page.value("document.getElementById('begin').click()")
    number = 0
    while True:
        ready(page)
        if not page.value("document.getElementById('end').hidden"):
            break
        if number == 0:
            found += layout(page, size)
            if shot:
                page.shot(shot)
            # Ends with the waiting where a film does not play.
            wait_until(page, "[...document.querySelectorAll('video')].every((v) => v.currentTime > 0 && !v.paused)")
        if number == 3:
            found += page.complaints()
            page.reload()
            ready(page)
            if page.value(STATE + ".answers.length") != 3:
                found.append("a reload does not go on")
        sign = page.value("[...document.querySelectorAll('.film')].findIndex((f) => f.querySelector('.sign'))")
        bright = brightness(page)
        best = max(range(len(bright)), key=bright.__getitem__)
        place = best if sign < 0 else sign if careful else 1 - sign
        choose(page, place, key=number % 2)
        wait_until(page, STATE + f".answers.length === {number + 1}")
        number += 1
    answers = json.loads(page.value("document.getElementById('text').value"))
    found += page.complaints()
    page.close()
    return answers, found


def check_answers(all_answers):
    found = []
    for answers in all_answers:
        given = [a for a in answers["answers"] if not a.get("check")]
        if len(given) != PAIRS or len(answers["answers"]) != PAIRS + CHECKS or answers["trials"] != PAIRS + CHECKS:
            found.append(f"{len(given)} choices and {len(answers['answers'])} answers")
        if answers["answers"][0].get("check"):
            found.append("a check stands first")
        for a, b in ((0, 1), (0, 2), (1, 2)):
            orders = [x["shown"] for x in given if sorted(x["shown"]) == [a, b]]
            if len(orders) != len(CLIPS) or orders.count([a, b]) != len(CLIPS) // 2:
                found.append(f"the places of {a} and {b} are not counterbalanced: {orders}")
    orders = {tuple((x["clip"], tuple(x["shown"])) for x in answers["answers"]) for answers in all_answers}
    if len(orders) != len(all_answers):
        found.append("two participants have the same order")
    return found


def check_analysis(regrade, folder, all_answers):
    found, files = [], []
    for i, answers in enumerate(all_answers):
        files.append(os.path.join(folder, f"answers_{i}.json"))
        with open(files[-1], "w", encoding="utf-8") as file:
            json.dump(answers, file)
    out = os.path.join(folder, "analysis.json")
    status, text = program(regrade, "study", *files, "--out", out)
    if status:
        return [text]
    with open(out, encoding="utf-8") as file:
        analysis = json.load(file)
    rows = {row["name"]: row for row in analysis["methods"]}
    if analysis["participants"] != len(all_answers) - 1 or analysis["failed_checks"] != 1:
        found.append("the careless participant is counted: " + text)
    if rows["lovely"]["share"] != 1 or rows["dull"]["share"] != 0 or rows["plain"]["share"] != 0.5:
        found.append("wrong shares: " + text)
    if not rows["lovely"]["share_low"] > 0.5 > rows["dull"]["share_high"]:
        found.append("wrong intervals: " + text)
    status, text = program(regrade, "study", files[0], files[0])
    if status != 3 or "is in two files" not in text:
        found.append("a participant counts twice: " + text)
    return found


def main():
    parser = parser_of(__doc__)
    parser.add_argument("regrade", help="the program")
    arguments = parsed(parser)
    if not shutil.which("ffmpeg"):
        print("ffmpeg is not installed (Debian package ffmpeg)")
        return NO_CHROMIUM
    found, all_answers = [], []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        make_films(folder)
        page = os.path.join(folder, "study.html")
        status, text = program(arguments.regrade, "study", *(os.path.join(folder, m) for m in METHODS), "--out", page)
        if status:
            print(text)
            return 1
        with open(page, encoding="utf-8") as file:
            text = file.read()
        if '"seconds":3.0' not in text:
            found.append("the page does not say how long films are seen")
        with open(page, "w", encoding="utf-8") as file:  # nobody looks at the films
            file.write(text.replace('"seconds":3.0', '"seconds":0.2'))
        with running(arguments.chromium) as browser:
            for i, name in enumerate(["phone", "desktop", "phone", "desktop"]):
                shot = os.path.join(arguments.shots, f"study_{name}.png") if arguments.shots and i < 2 else None
                answers, complaints = take_part(browser, page, SIZES[name], careful=i != 2, shot=shot)
                all_answers.append(answers)
                found += [f"{name}: {complaint}" for complaint in complaints]
        found += check_answers(all_answers) + check_analysis(arguments.regrade, folder, all_answers)
    return status_of("look_at_study", found)


if __name__ == "__main__":
    sys.exit(main())
