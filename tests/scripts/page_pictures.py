"""Pictures of a scene page, compared with the program's; a module of other scripts."""

import base64
import json
import math

# The shader's arithmetic is the program's in another order of sums: measured 70 dB and more, where one unit of 255
# everywhere would be 48 dB. Styles go through another sine, and both round to codes: a code more or less is 1 / 127 of
# the largest coefficient.
SOURCE_DB, STYLED_DB, WITHIN_ONE = 55, 50, 0.999


def pixels_of(page, view):
    text = page.value("(async () => { const p = await regradePage.picture(" + json.dumps(view) + ");"
                      "let s = ''; for (const b of p) s += String.fromCharCode(b); return btoa(s) })()")
    data, width, height = base64.b64decode(text), view["width"], view["height"]
    rows = [data[4 * width * y:4 * width * (y + 1)] for y in reversed(range(height))]
    return bytes(b for row in rows for i, b in enumerate(row) if i % 4 < 3)


def compare_pictures(page, views):
    found, worst = [], {}
    for i, view in enumerate(views):
        want = base64.b64decode(view["pixels"])
        got = pixels_of(page, {key: value for key, value in view.items() if key != "pixels"})
        error = sum((a - b) ** 2 for a, b in zip(got, want)) / len(want)
        decibels = 99 if error == 0 else 10 * math.log10(255 ** 2 / error)
        near = sum(abs(a - b) <= 1 for a, b in zip(got, want)) / len(want)
        styled = view["weights"][0] > 0
        worst[styled] = min(worst.get(styled, (99, 1)), (decibels, near))
        if decibels < (STYLED_DB if styled else SOURCE_DB) or (not styled and near < WITHIN_ONE):
            found.append(f"view {i}: {decibels:.1f} dB from the program's picture, {100 * near:.2f} % within 1 of 255")
    for styled, (decibels, near) in worst.items():
        print(f"  {'styled' if styled else 'source'}: worst {decibels:.1f} dB, {100 * near:.2f} % within 1 of 255")
    return found
