#include "pipeline/capture/nsvf_cameras.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "kernels/base/error.h"
#include "kernels/base/number_text.h"
#include "pipeline/capture/rigid_matrix.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

constexpr double kMostNsvfSkew = 1e-3;  // of the focal length
constexpr double kMostPixels = 1e9;     // of a focal length or a place

using Lines = std::vector<std::vector<double>>;

// Whether the lines are a matrix of rows x columns numbers, in any arrangement of lines that
// keeps rows whole, or in one line.
bool IsMatrix(const Lines& lines, size_t rows, size_t columns) {
  if (lines.size() == 1) return lines[0].size() == rows * columns;
  return lines.size() == rows &&
         std::ranges::all_of(lines, [&](const auto& line) { return line.size() == columns; });
}

std::vector<double> Flat(const Lines& lines) {
  std::vector<double> numbers;
  for (const auto& line : lines) numbers.insert(numbers.end(), line.begin(), line.end());
  return numbers;
}

}  // namespace

Camera ReadNsvfIntrinsics(const std::string& path) {
  const Lines lines = ReadNumberFile(path);
  Camera camera;
  size_t columns = 0;
  for (const auto& [r, c] : {std::pair<size_t, size_t>{3, 3}, {3, 4}, {4, 4}})
    if (IsMatrix(lines, r, c)) columns = c;
  if (columns > 0) {
    const std::vector<double> k = Flat(lines);
    camera.fx = k[0];
    camera.fy = k[columns + 1];
    camera.cx = k[2];
    camera.cy = k[columns + 2];
    if (!(std::abs(k[1]) <= kMostNsvfSkew * std::abs(camera.fx)))
      throw InputError("its pixels are skewed", path, "undistort the pictures first");
  } else if (lines[0].size() >= 3) {
    camera.fx = camera.fy = lines[0][0];
    camera.cx = lines[0][1];
    camera.cy = lines[0][2];
  } else {
    throw InputError("is neither a matrix nor a line of focal length and principal point",
                     path);
  }
  if (!(camera.fx > 0 && camera.fy > 0))
    throw InputError("its focal length is not positive", path);
  for (const double pixels : {camera.fx, camera.fy, camera.cx, camera.cy})
    if (!(std::abs(pixels) <= kMostPixels))
      throw InputError("its focal length or principal point is beyond all pictures", path);
  return camera;
}

RigidTransform ReadNsvfPose(const std::string& path) {
  const Lines lines = ReadNumberFile(path);
  if (!IsMatrix(lines, 3, 4) && !IsMatrix(lines, 4, 4))
    throw InputError("is not a matrix of 3 x 4 or 4 x 4 numbers", path);
  const std::optional<RigidTransform> world_from_camera = RigidFromRows(Flat(lines).data());
  if (!world_from_camera) throw InputError("is not a rotation and a translation", path);
  return world_from_camera->Inverse();
}

WorldBox ReadNsvfBox(const std::string& path) {
  const std::vector<double> numbers = Flat(ReadNumberFile(path));
  if (numbers.size() < 6) throw InputError("does not hold two corners", path);
  WorldBox box;
  for (int a = 0; a < 3; ++a) {
    box.low[a] = numbers[static_cast<size_t>(a)];
    box.high[a] = numbers[static_cast<size_t>(a) + 3];
  }
  if (!IsSound(box)) throw InputError("the box has no volume, or is beyond all scenes", path);
  return box;
}

NsvfSplit SplitNsvf(const std::vector<std::string>& names) {
  NsvfSplit split;
  std::set<std::string> of[3];
  for (const std::string& name : names)
    for (const int kind : {0, 1, 2})
      if (name.starts_with(std::to_string(kind) + "_")) of[kind].insert(name);
  split.test = of[2].empty() ? of[1] : of[2];
  if (of[0].empty() || split.test.empty()) return {};
  split.only = of[0];
  split.only.insert(split.test.begin(), split.test.end());
  return split;
}

namespace {

constexpr uint64_t kMostNumberBytes = 64 << 10;
constexpr char kBetween[] = " \t\r,";

double NumberOf(std::string_view word, const std::string& where) {
  double value = 0;
  if (!ParseNumber(word, &value) || !std::isfinite(value))
    throw InputError("'" + Printable(word.substr(0, 40)) + "' is not a number", where,
                     "the file is damaged, or was written by another program");
  return value;
}

}  // namespace

std::vector<std::vector<double>> ReadNumberFile(const std::string& path) {
  const std::string text = ReadWholeFile(path, kMostNumberBytes);
  std::vector<std::vector<double>> lines;
  int number = 0;
  for (const std::string& line : Split(WithoutByteOrderMark(text), '\n')) {
    ++number;
    std::vector<double> values;
    for (size_t at = line.find_first_not_of(kBetween); at != std::string::npos;) {
      const size_t end = std::min(line.find_first_of(kBetween, at), line.size());
      values.push_back(NumberOf(std::string_view(line).substr(at, end - at),
                                path + ":" + std::to_string(number)));
      at = line.find_first_not_of(kBetween, end);
    }
    if (!values.empty()) lines.push_back(std::move(values));
  }
  if (lines.empty()) throw InputError("holds no numbers", path);
  return lines;
}

}  // namespace regrade
