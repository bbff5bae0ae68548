#include "pipeline/commands/frame_folder.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>

#include "kernels/base/error.h"
#include "pipeline/files/folder_listing.h"

namespace regrade {
namespace {

// "shot_00012.png": the text before the last digits of the stem, and the digits.
struct NumberedName {
  std::string before, digits;
  int64_t number = 0;
};

std::optional<NumberedName> SplitName(const std::string& name) {
  std::string stem = std::filesystem::path(name).replace_extension().string();
  const auto digit = [&](size_t i) {
    return std::isdigit(static_cast<unsigned char>(stem[i])) != 0;
  };
  size_t end = stem.size();
  while (end > 0 && !digit(end - 1)) --end;
  size_t begin = end;
  while (begin > 0 && digit(begin - 1)) --begin;
  if (begin == end || end - begin > 15) return std::nullopt;  // 15 digits fit an int64
  const std::string digits = stem.substr(begin, end - begin);
  return NumberedName{stem.substr(0, begin), digits, std::stoll(digits)};
}

// Empty unless all names are one prefix and a number.
std::vector<NumberedName> Numbers(const std::vector<std::string>& names) {
  std::vector<NumberedName> numbers;
  for (const std::string& name : names) {
    const auto split = SplitName(name);
    if (!split || (!numbers.empty() && split->before != numbers.front().before)) return {};
    numbers.push_back(*split);
  }
  return numbers;
}

std::string Padded(int64_t number, size_t digits) {
  const std::string text = std::to_string(number);
  return std::string(digits > text.size() ? digits - text.size() : 0, '0') + text;
}

void CheckNumbers(const FrameFolder& frames) {
  const std::vector<NumberedName> numbers = Numbers(frames.names);
  if (numbers.size() < 2) return;
  int64_t step = numbers[1].number - numbers[0].number;  // 2 where every other frame was kept
  for (size_t i = 1; i < numbers.size(); ++i)
    step = std::min(step, numbers[i].number - numbers[i - 1].number);
  for (size_t i = 1; i < numbers.size(); ++i) {
    const NumberedName &last = numbers[i - 1], &next = numbers[i];
    const std::string both = frames.names[i - 1] + " and " + frames.names[i];
    if (next.number == last.number)
      throw InputError(both + " have the same number", frames.folder, "keep one of them");
    if (step > 0 && next.number != last.number + step)
      throw InputError("frame " + Padded(last.number + step, last.digits.size()) +
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

void CheckSameFrames(const FrameFolder& reference, const FrameFolder& sequence) {
  if (reference.width != sequence.width || reference.height != sequence.height)
    throw InputError("frames of " + SizeText(sequence.width, sequence.height) +
                         ", the reference has " + SizeText(reference.width, reference.height),
                     sequence.folder, "render all sequences at one size");
  if (reference.paths.size() == sequence.paths.size()) return;
  const bool more = reference.paths.size() > sequence.paths.size();
  const FrameFolder &longer = more ? reference : sequence,
                    &shorter = more ? sequence : reference;
  std::string missing;
  const std::vector<NumberedName> some = Numbers(shorter.names), all = Numbers(longer.names);
  std::set<int64_t> known;
  for (const NumberedName& name : some) known.insert(name.number);
  for (size_t i = 0; i < all.size() && !known.empty() && missing.empty(); ++i)
    if (!known.count(all[i].number))
      missing = "; " + longer.names[i] + " of " + longer.folder + " has no counterpart";
  throw InputError(Concat(sequence.paths.size(), " frames, the reference has ",
                          reference.paths.size(), missing),
                   sequence.folder, "evaluate the same frames of each");
}

}  // namespace regrade
