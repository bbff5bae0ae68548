#include "pipeline/commands/frame_folder.h"

#include <algorithm>
#include <cmath>

#include "kernels/base/error.h"
#include "pipeline/commands/frame_numbers.h"
#include "pipeline/files/folder_listing.h"

namespace regrade {
namespace {

// Uneven times, as those of a clock, are longer.
constexpr size_t kMostDigitsOfCount = 9;

void CheckNumbers(const FrameFolder& frames) {
  const std::vector<FrameNumber> numbers = FrameNumbers(frames.names);
  if (numbers.size() < 2) return;
  int64_t step = numbers[1].number - numbers[0].number;  // 2 where every other frame was kept
  for (size_t i = 1; i < numbers.size(); ++i)
    step = std::min(step, numbers[i].number - numbers[i - 1].number);
  for (size_t i = 1; i < numbers.size(); ++i) {
    const FrameNumber &last = numbers[i - 1], &next = numbers[i];
    const std::string both = frames.names[i - 1] + " and " + frames.names[i];
    if (next.number == last.number)
      throw InputError(both + " have the same number", frames.folder, "keep one of them");
    if (step > 0 && next.number != last.number + step && next.digits <= kMostDigitsOfCount)
      throw InputError("frame " + PaddedNumber(last.number + step, last.digits) +
                           " is missing between " + both,
                       frames.folder, "add it, or renumber the frames without a gap");
  }
}

bool HasFineValues(const Image& image) {
  return std::ranges::any_of(image.pixels, [](float value) {
    const float level = 255 * value;
    return std::abs(level - std::round(level)) > 1e-3f;  // float rounding is 3e-5
  });
}

std::string SizeText(int width, int height) { return Concat(width, " x ", height, " px"); }

// Grey is replicated, so that grey frames compare with coloured ones.
Image Coloured(Image image) {
  if (image.channels != 1) return image;
  Image color(image.width, image.height, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    std::fill_n(&color.pixels[3 * i], 3, image.pixels[i]);
  return color;
}

}  // namespace

FrameSource FrameFolder::Source() const {
  return {static_cast<int>(paths.size()), [paths = paths, kept = kept](int i) {
            return Coloured(kept.Read(paths.at(static_cast<size_t>(i))));
          }};
}

FrameFolder OpenFrameFolder(const std::string& folder, const ProgressFunction& progress) {
  FrameFolder frames;
  frames.folder = folder;
  for (const ListedFile& file : ListFolder(folder).files) {
    if (!file.problem.empty())
      throw InputError("a frame cannot be opened: " + file.problem, folder + "/" + file.name,
                       "keep only the frames in this folder");
    frames.places.push_back(static_cast<int>(frames.paths.size()));
    frames.paths.push_back(file.path);
    frames.names.push_back(file.name);
  }
  if (frames.paths.empty()) throw InputError("there are no frames here", folder);
  CheckNumbers(frames);
  bool alpha = false, fine = false;
  for (size_t i = 0; i < frames.paths.size(); ++i) {
    const Image image = frames.kept.Read(frames.paths[i]);
    alpha |= image.channels == 4;
    fine = fine || HasFineValues(image);
    if (i == 0) {
      frames.width = image.width;
      frames.height = image.height;
    }
    if (image.width != frames.width || image.height != frames.height)
      throw InputError("this frame is " + SizeText(image.width, image.height) + ", " +
                           frames.names.front() + " is " +
                           SizeText(frames.width, frames.height),
                       frames.paths[i], "render all frames at one size");
    ReportOrThrow(progress, i + 1, frames.paths.size());
  }
  if (alpha) frames.notice = folder + ": frames have transparency, which is ignored";
  if (fine)
    frames.notice += (alpha ? "; they have" : folder + ": frames have") +
                     std::string(" more than 8 bits, which are used; flow sees 8");
  return frames;
}

}  // namespace regrade
