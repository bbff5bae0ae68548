// `regrade evaluate --frames` from tests: the program, and frames of a moving wave.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "pipeline/files/json_file.h"
#include "pipeline/images/image_file.h"
#include "tests/support/run_program.h"
#include "tests/support/temporary_folder.h"

namespace regrade::testing {

inline ProgramOutcome Evaluate(const std::vector<std::string>& arguments) {
  return Regrade({"evaluate"}, arguments);
}

// The consistency of a sequence in a report.
inline JsonValue RowOf(const JsonValue& report, const std::string& sequence, int gap = 1) {
  for (const JsonValue& row : report.At("consistency").AsArray())
    if (row.At("sequence").AsString() == sequence && row.At("gap").AsInt() == gap) return row;
  ADD_FAILURE() << "no row of " << sequence << " at gap " << gap;
  return {};
}

// A wave that moves by a pixel per frame.
inline Image Frame(int i, float flicker = 0) {
  Image image(64, 48, 3);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x)
      for (int c = 0; c < 3; ++c)
        image.at(x, y)[c] =
            static_cast<float>(0.5 + 0.2 * std::sin(0.4 * (x - i) + 0.2 * y + c) +
                               0.15 * std::sin(0.3 * y) + flicker * ((i * 37) % 5 - 2));
  return image;
}

inline void WriteFrames(const std::string& folder, int count, float flicker = 0) {
  for (int i = 0; i < count; ++i)
    WriteText(folder + "/0000" + std::to_string(i) + ".png", EncodePng8(Frame(i, flicker)));
}

}  // namespace regrade::testing
