#!/usr/bin/env python3
"""Checks that retired words and identifiers do not come back, in texts and in file names.

  check_words.py [--root DIR]   checks all files of the tree but CHANGELOG.md; prints FILE:LINE and the word to use

Exit status: 0, or 1 if there is a finding. A row of RULES is a regular expression, the word to use, texts that must
be found and similar texts that must not.
"""

import re
import sys

from tree_files import parser_of, text_of, tree_files

# Not checked: the history, this list and its test.
EXEMPT = ("CHANGELOG.md", "scripts/check_words.py", "tests/scripts/check_words_test.py")

# (regular expression, plain word, texts that must be found, texts that must not)
RULES = (
    # Poses.
    (r"(?i)sighting", "observation", ["kSightings", "a sighting"], ["sight"]),
    (r"(?i)\brungs?\b", "attempt", ["the next rung"], ["wrung"]),
    (r"(?i)ladder", "strategies", ["colmap_ladder.h"], []),
    (r"(?i)verdict", "status (of a photo), LoopControl", ["PhotoVerdict", "Verdict::kGo", "a verdict"], []),
    (r"(?i)\boutlines?\b(?!\s*:|-)", "silhouette", ["an outline", "Outlines"], ["outline:3px", "outline-offset"]),
    (r"(?i)\bclimb(s|ed|ing)?\b|Climb", "gradient ascent; try further strategies", ["climbed to", "AttemptResult Climb()"], []),
    # Metrics, costs.
    (r"[\"']figures?[\"']|--figures?\b|\bFigures?\s*[{&*<>(;]|\bk?Figures?[A-Z_]|[a-z_](?<!con)(figure|Figure)s?\b|\bfigures?_|"
     r"\bfigures?[\[(]|\bfigures\.\w|\bfigures?\s=\s",
     "metric", ["report[\"figures\"]", "struct Figure {", "figures = {}", "figures(part)", "kFigures", "figures.json"],
     ["the figures of a run", "Figures are PSNR in dB", "Wu et al., Fig. 3", "<figure>", "figure{margin:0}",
      "figure+figure", "figure.querySelector(q)", "encoder.configure(c)"]),
    (r"(?i)\bknobs?\b|knobs?_|_knobs?\b", "parameter", ["every knob", "price_knobs"], ["knobbly"]),
    (r"(?i)\bprice(s|d)?\b|\bpricing\b|\bPrice[A-Z]|price_|_prices?\b", "cost",
     ["at the price of", "PriceRow", "PRICES.md", "price_list"], ["enterprise"]),
    (r"[\"']planes?[\"']\s*[:\]]|--planes?\b|\b(variant|parameter)\.plane\b|PlaneOf", "benchmark", ["variant.plane", "--plane", "row[\"plane\"]"],
     ["the image plane", "features.plane(c)", "focal_plane", "\"a cloud\", \"plane\")"]),
    (r"(?i)yardstick", "baseline", ["no yardstick", "IsAYardstick"], []),
    # Styles and bounds.
    (r"\b[Ll]essons?\b|Lessons|\bLESSON", "training target, style_targets", ["struct Lessons", "no lesson"], ["lessen"]),
    (r"\b[Tt]aught\b", "trained; training views", ["taught views"], []),
    (r"observed_slope|ObservedSlope|\bslope_(observed|sampled|max|found|at)|_slope_(observed|max)|steepest_(seen|found)",
     "local_lipschitz", ["slope_observed"], ["slope = 2"]),
    (r"[\"']open[\"']\s*[,:]|== [\"']open[\"']|\bopen_\b|\.open\b(?!\s*\()|\bis_open\b(?!\()|\bkOpenTransmittance\b",
     "transparent, unclamped", ["{\"open\", 1}", "report.open;", "open_.data()"],
     ["file.open(path)", "is_open()", "kOpenCv", "open(path)", "zip_open_from_source", "Real<F>(\"open\")(path)"]),
    # Program flow.
    (r"\bkRoad\b|[Rr]oad_?[Cc]ommand|\b[Tt]he (whole )?road\b", "kStages, the pipeline",
     ["kRoad", "the whole road"], ["broad", "a road in the scene"]),
    (r"(?i)milestone", "StageEntry", ["Milestone"], []),
    (r"\bkFinish\b", "LoopControl::kStop", ["kFinish"], ["kFinished"]),
    (r"(?i)rehears", "crash_probe", ["rehearsal.h", "Rehearse"], []),
    # Tests.
    (r"(?i)care_?outs?\b|\bcares?\b (that was )?taken out|\btakes? (the|a) care\b|\bcares\b|\bprice_of_safety|"
     r"kill_loop|tight_limits|fail_each_write",
     "safeguard, mutation test", ["care_outs.py", "Cares taken out", "each of the cares"], ["take care of", "careful"]),
    (r"[\"']care[\"']", "safeguard", ["entry[\"care\"]"], []),
    # Architecture.
    (r"\b[Dd]oors?\b", "third-party allow-list", ["a door"], ["doorbell", "indoors"]),
    (r"check_floors|\b([Aa]ny|[Ee]ach|[Ee]very|[Ll]ower|[Uu]pper|[Hh]igher|[Ss]ame|[Ww]hich|[Oo]ne) floors?\b|"
     r"\b[Ff]loors (and|of)\b|\b[Ff]loor \d",
     "layer", ["from any floor", "Floors and doors", "floor 3"], ["std::floor(x)", "the noise floor", "nearest_mode=\"floor\""]),
    (r"\b[Nn]ouns?\b", "type", ["two nouns"], ["pronouns"]),
    (r"\b[Ww]ings?\b", "module", ["one wing"], ["swing", "following"]),
    # Phrases.
    (r"\b([Nn]o|[Aa]|[Aa]ny|its|their) say\b|\bsay in (it|them|the)\b|NoSay\b|[Hh]a(s|ve|d) a say\b",
     "is ignored, is held out, is used", ["have no say", "without a say", "GreyHasNoSay"], ["we say so", "a saying"]),
    (r"(?i)\bstrangers?\b", "untrusted", ["a stranger's file"], ["stranger_things", "estranged"]),
    (r"\b(is|are|was|were|be|been|being) told\b", "reported, given; distinguished", ["is told of", "cannot be told apart"],
     ["has told"]),
    (r"\bof one mind\b", "consensus", ["all of one mind"], []),
    (r"\b[Ff]or want of\b", "too few, lack of", ["for want of evidence"], []),
    (r"\b[Aa]s (they|it) came\b", "initial, unchanged", ["poses as they came"], []),
    (r"\b[Ww]ish(es|ed)?\b|\bWish(es)?[A-Z]", "override, option", ["at your wish", "wishes", "WishesAreRead"],
     ["swish", "wishbone"]),
    (r"(?i)\bwrecks?\b", "corrupt", ["a wreck"], ["shipwrecked"]),
)


def findings_in(path, text):
    """[(line, what, plain word)] for a file; line 0 is its name."""
    found = []
    for pattern, plain, *_ in RULES:
        match = re.search(pattern, path)
        if match:
            found.append((0, match.group(0), plain))
        if not re.search(pattern, text):
            continue
        for number, line in enumerate(text.splitlines(), 1):
            found += [(number, match.group(0), plain) for match in re.finditer(pattern, line)]
    return sorted(found)


def check_tree(root):
    """[(path, line, what, plain word)]"""
    return [(path, *finding) for path in tree_files(root) if path not in EXEMPT
            for finding in findings_in(path, text_of(root, path))]


def main():
    arguments = parser_of(__doc__).parse_args()
    findings = check_tree(arguments.root)
    for path, line, what, plain in findings:
        where = f"{path}:{line}" if line else f"{path}: the file's name"
        print(f"{where}: '{what}': write {plain}")
    print(f"check_words: {len(findings)} findings")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
