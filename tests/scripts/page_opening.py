"""How a scene page opens: styled, the coarse scene first, then the whole one, with workers and without; a module of other scripts."""

from browser import FEW_PIXELS, SIZES, Page, complaints, open_page, wait_until
from page_pictures import compare_pictures

# Workers' answers with a field wait until the test lets them through.
HELD = """(() => {
  const Own = globalThis.Worker, go = new Promise((done) => globalThis.letThrough = done);
  globalThis.Worker = class {
    constructor(url) {
      this.own = new Own(url);
      this.own.onmessage = (event) => event.data.made ? go.then(() => this.onmessage(event)) : this.onmessage(event);
      this.own.onerror = (event) => this.onerror?.(event);
    }
    postMessage(...what) { this.own.postMessage(...what); }
    terminate() { this.own.terminate(); }
  };
})();"""

NO_WORKERS = "globalThis.Worker = class { constructor() { throw new Error('no workers for files') } };"
# A worker that starts and ends at once with an error, as one whose script is refused.
BROKEN_WORKERS = ("globalThis.Worker = class { constructor() { setTimeout(() => this.onerror?.({preventDefault() {}, message: ''}), 5) } "
                  "postMessage() {} terminate() {} };")

# Mean squares of the canvas: from the picture kept under a name, and of its own colours around their mean.
CANVAS = """((name) => {
  const g = regradePage.painter.full, pixels = regradePage.graphics.read(g), kept = (globalThis.kept ??= {});
  const mean = [0, 0, 0], n = pixels.length / 4;
  let spread = 0, apart = 0;
  for (let i = 0; i < pixels.length; ++i) if (i % 4 < 3) mean[i % 4] += pixels[i] / n;
  for (let i = 0; i < pixels.length; ++i) if (i % 4 < 3) spread += (pixels[i] - mean[i % 4]) ** 2 / (3 * n);
  if (kept[name]) for (let i = 0; i < pixels.length; ++i) if (i % 4 < 3) apart += (pixels[i] - kept[name][i]) ** 2 / (3 * n);
  kept[name] ??= pixels;
  return [apart, spread];
})('NAME')"""


# What each drawn scene shows first, noted as the painter takes it: whether it has the style that is wanted.
TAKEN = """(() => {
  const {painter} = regradePage, take = painter.take;
  globalThis.taken = [];
  painter.take = (scene) => {
    taken.push(regradePage.setsOf(regradePage.weights(), scene).some((set) => set.colors !== scene.source));
    take.call(painter, scene);
  };
})()"""


def check_styled_first(page):
    """While the whole scene is held back, the coarse one has the style, and its slider works; the words name what is not there yet."""
    found = []
    style = page.value("regradePage.header.styles[0]")
    if page.value("regradePage.weights()[0]") != style["strength"]:
        found.append("the style does not begin with its strength")
    for_object = bool((style.get("residual") or {}).get("weight"))
    words = page.value("message.textContent")
    # What a style does to an object only is not known of a coarse scene.
    if page.value("style0.disabled") != for_object or (style["name"] in words) != for_object:
        found.append(f"the slider of what {'is not' if for_object else 'is'} shown is wrong, or the words: '{words}'")
    if for_object:
        return found
    page.value(CANVAS.replace("NAME", "styled"))
    page.value("style0.value = 0; style0.dispatchEvent(new Event('input')); 0")
    wait_until(page, "regradePage.painter.settled")
    if page.value(CANVAS.replace("NAME", "styled"))[0] < 10:
        found.append("the coarse scene is not styled, or its slider does nothing")
    page.value("style0.value = 100; style0.dispatchEvent(new Event('input')); 0")
    wait_until(page, "regradePage.painter.settled")
    return found


def check_coarse_first(browser, path):
    """While the whole scene is held back, the coarse one is drawn and answers keys; then it is replaced, and its bytes are free."""
    found = []
    page = Page(browser, path, SIZES["phone"], before=HELD, scale=FEW_PIXELS)
    try:
        wait_until(page, "!!globalThis.regradePage?.painter?.shown")
    except RuntimeError:
        return ["nothing is drawn before the whole scene is there"]
    if not page.value("regradePage.painter.shown.coarse === true && !regradePage.picture"):
        found.append("what is drawn first is not the coarse scene")
    wait_until(page, "regradePage.painter.settled")
    if page.value(CANVAS.replace("NAME", "coarse"))[1] < 10:
        found.append("the coarse picture is of one colour")
    found += check_styled_first(page)
    page.value("globalThis.kept = null; home.click(); 0")
    wait_until(page, "regradePage.painter.settled")
    page.value(CANVAS.replace("NAME", "coarse"))
    page.value("globalThis.seen = JSON.stringify(regradePage.view.save()); 0")
    page.call("Input.dispatchKeyEvent", type="keyDown", key="ArrowRight")
    try:
        wait_until(page, "JSON.stringify(regradePage.view.save()) !== seen", 20)
    except RuntimeError:
        found.append("the coarse scene does not turn")
    page.call("Input.dispatchKeyEvent", type="keyUp", key="ArrowRight")
    wait_until(page, "regradePage.painter.settled")
    page.value("home.click(); 0")
    coarse = page.value("regradePage.painter.scene.parts.length")
    page.value(TAKEN)
    page.value("letThrough(); 0")
    wait_until(page, "!!regradePage.picture && regradePage.begun && regradePage.painter.settled && message.textContent === ''")
    if page.value("!!regradePage.painter.shown.coarse || regradePage.painter.scene !== regradePage.scene"):
        found.append("the coarse scene stays")
    if page.value("taken.join()") != "true" or page.value("style0.disabled"):
        found.append("the whole scene is shown without its style, or not once")
    apart, spread = page.value(CANVAS.replace("NAME", "coarse"))
    print(f"  coarse picture: {apart:.0f} in mean square from the whole one, whose own colours spread by {spread:.0f}")
    # An unrelated picture of the same colours would be twice their spread apart. The scenes are random: their means say little.
    if not 0 < apart < 2 * spread:
        found.append("the coarse picture has nothing of the whole one, or is not coarse")
    # What the scene and a style need, and what is drawn into; nothing of the coarse scene.
    counted = page.value("""(() => {
      const p = regradePage, {scene, painter} = p, sum = (list) => list.filter(Boolean).reduce((all, t) => all + t.bytes, 0);
      const sets = [scene.source, ...p.colors.filter(Boolean)], {empty} = p.graphics;
      const {full, coarse} = painter, parts = [...scene.parts, scene.corners, ...sets.map((s) => s.color)];
      return [p.graphics.bytes, sum([...new Set(parts), full, full.sum, coarse, coarse.sum, empty.u, empty.p])];
    })()""")
    if counted[0] != counted[1] or coarse <= 0:
        found.append(f"{counted[0]} bytes are on the graphics processor, and the scene needs {counted[1]}")
    found += complaints(page)
    page.close()
    return found


def check_without_workers(browser, path, views, broken):
    """Without workers, and with broken ones where `broken` says so: from there on the page does the same."""
    found = []
    for name, script in [("no workers", NO_WORKERS)] + [("broken workers", BROKEN_WORKERS)] * broken:
        page = open_page(browser, path, SIZES["phone"], script, FEW_PIXELS)
        found += [f"{name}: {c}" for c in compare_pictures(page, views[:1] + views[-1:]) + complaints(page)]
        page.close()
    return found
