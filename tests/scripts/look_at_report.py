#!/usr/bin/env python3
"""Opens a report page in headless Chromium at the sizes of a phone and a desktop, and checks it.

  look_at_report.py REPORT.html [--shots FOLDER] [--chromium PROGRAM]

Checked at each width: nothing on the console, nothing asked of the network (films beside the page are files), no
scrolling sideways, every picture decoded, every chart visible, the slider cuts the picture where it is pulled to; and
without JavaScript the charts are visible, too.
--shots keeps pictures of the whole page. Exit status 1 if anything is wrong, 77 if there is no Chromium.
"""

import os
import sys

from browser import SIZES, Page, complaints, parsed, parser_of, running, status_of


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
    parser = parser_of(__doc__)
    parser.add_argument("report", help="the report page")
    arguments = parsed(parser)
    if not os.path.isfile(arguments.report):
        parser.error(arguments.report + " is not a file")
    with running(arguments.chromium) as browser:
        found = check_report(browser, arguments)
    return status_of("look_at_report", found)


if __name__ == "__main__":
    sys.exit(main())
