// regrade evaluate --frames: options, and the evaluation of folders of frames.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "evaluate/consistency.h"
#include "evaluate/protocols.h"
#include "evaluate/table_text.h"
#include "pipeline/commands/command.h"

namespace regrade {

struct FramesOptions {
  std::vector<std::string> frames, names;
  std::string cameras;  // of --cameras, which files of splats have, too
  std::string reference, target, style, depth, out, protocol, format = "text", require, junit,
                                                              config;

  template <typename Bind>
  void Describe(Bind& bind) {
    bind("frames", frames,
         {.help =
              "folder with the styled frames and no other files; sorted by name, 9 before 10; "
              "several folders, one after the other, are compared with the first one, pair by "
              "pair"});
    bind(
        "name", names,
        {.help = "what tables call each of --frames or --splats, in the same order; without it "
                 "styled, styled_2, ... Of a run: the style, by default the last one"});
    bind("reference", reference,
         {.help = "folder with the same frames before styling; motion and masks come from "
                  "them. Frames belong together by the numbers in their names, or else by "
                  "equal names, or else by order. Of --splats: the file of splats before "
                  "styling"});
    bind("target", target,
         {.help = "folder with the 2D method's version of each frame, for fidelity"});
    bind("style", style, {.help = "style picture, for fidelity"});
    bind("depth", depth,
         {.help = "of --mode geometry: folder with a depth map of each frame of --reference, "
                  ".npy of height x width, along the optical axis in the unit of --cameras"});
    // Stands for other options, which ExpandProtocol() puts in its place.
    bind("protocol", protocol,
         {.help = "a published protocol by name, also for runs: sets --mode, --gaps, "
                  "--warp and --error-per where it says so, and refuses other values; geometry "
                  "of frames needs --cameras and --depth; evaluate/PROTOCOLS.md defines each",
          .choices = ProtocolChoices()});
    bind("format", format,
         {.help = "form of the printed tables; latex needs the package booktabs",
          .choices = kTableForms});
    bind("require", require, {.help = kRequireHelp});
    bind("junit", junit, {.help = kJUnitHelp});
    bind("config", config,
         {.help = "{\"NAME\": VALUE, ...} of --help-constants, in a file or here"});
    bind("out", out,
         {.help = "folder for report.html, report.json, heatmaps/ of the worst pairs and, of "
                  "--splats, rendered/ with the frames"});
  }
};

// styled, styled_2, ...: what the report calls the frames of a folder, counted from 0.
std::string StyledName(size_t folder);

// Makes the frames of the folders that options name; returns sentences for below the tables.
using MakeFrames = std::function<std::vector<std::string>()>;

// `words` are those of the command line. `make`, which may be null, is called once the options
// are checked, before any frame is read.
void EvaluateFrames(const FramesOptions& frames, const ConsistencyOptions& options,
                    const Arguments& words, Console* console, const MakeFrames& make = {});

}  // namespace regrade
