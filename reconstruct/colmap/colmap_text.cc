// Format: colmap.github.io/format.html. Lines that begin with '#' are comments. An image has
// two lines: the first ends with its name, which may contain spaces; the second, its keypoints,
// may be empty.
#include "reconstruct/colmap/colmap_text.h"

#include <algorithm>
#include <charconv>
#include <fstream>

#include "kernels/base/error.h"
#include "kernels/base/number_text.h"

namespace regrade {
namespace {

class LineReader {
 public:
  LineReader(std::string_view text, const std::string& path)
      : path_(path), text_(WithoutByteOrderMark(text)) {}

  // Moves to the next line that is not a comment; skips blank lines unless `blank_counts`.
  // False at the end.
  bool Next(bool blank_counts) {
    while (position_ < text_.size()) {
      const size_t end = std::min(text_.find('\n', position_), text_.size());
      line_ = text_.substr(position_, end - position_);
      position_ = end + 1;
      ++number_;
      if (!line_.empty() && line_.back() == '\r') line_.remove_suffix(1);
      if (!line_.empty() && line_[0] == '#') continue;
      if (!blank_counts && line_.find_first_not_of(" \t") == std::string_view::npos) continue;
      return true;
    }
    line_ = {};
    return false;
  }

  bool HasWord() {
    line_.remove_prefix(std::min(line_.find_first_not_of(" \t"), line_.size()));
    return !line_.empty();
  }
  std::string_view Word(const char* what) {
    if (!HasWord()) Fail(std::string("ends before ") + what);
    const std::string_view word = line_.substr(0, line_.find_first_of(" \t"));
    line_.remove_prefix(word.size());
    return word;
  }
  // The rest of the line, trimmed.
  std::string Rest(const char* what) {
    if (!HasWord()) Fail(std::string("ends before ") + what);
    return std::string(line_.substr(0, line_.find_last_not_of(" \t") + 1));
  }
  template <typename T>
  T Number(const char* what) {
    const std::string_view word = Word(what);
    T value{};
    if (!ParseNumber(word, &value))
      Fail("has '" + std::string(word.substr(0, 40)) + "' for " + what);
    return value;
  }
  const std::string& path() const { return path_; }
  int64_t number() const { return number_; }
  [[noreturn]] void Fail(const std::string& why) const {
    throw InputError(Concat("line ", number_, " ", why), path_,
                     "the file is damaged; let COLMAP write the model again");
  }

 private:
  std::string path_;
  std::string_view text_, line_;
  size_t position_ = 0;
  int64_t number_ = 0;
};

template <typename T>
void Append(std::string* bytes, const T& value) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof value);
}

ColmapLens LensOfName(std::string_view name, const LineReader& lines) {
  for (int i = 0; i < kNumColmapLenses; ++i)
    if (name == ColmapLensName(static_cast<ColmapLens>(i))) return static_cast<ColmapLens>(i);
  const std::string unknown =
      "has the unknown camera model '" + std::string(name.substr(0, 40)) + "'";
  if (name.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") != std::string_view::npos)
    lines.Fail(unknown);
  RefuseNewerLens(Concat("line ", lines.number(), " ", unknown), lines.path());
}

void AppendCamera(LineReader* lines, std::string* bytes) {
  Append(bytes, lines->Number<uint32_t>("a camera's id"));
  Append(bytes, static_cast<int32_t>(LensOfName(lines->Word("a camera model"), *lines)));
  Append(bytes, lines->Number<uint64_t>("a width"));
  Append(bytes, lines->Number<uint64_t>("a height"));
  while (lines->HasWord()) Append(bytes, lines->Number<double>("a camera's parameter"));
}

void AppendImage(LineReader* lines, std::string* bytes) {
  Append(bytes, lines->Number<uint32_t>("an image's id"));
  for (int i = 0; i < 7; ++i) Append(bytes, lines->Number<double>("a pose"));
  Append(bytes, lines->Number<uint32_t>("a camera's id"));
  bytes->append(lines->Rest("an image's name")).push_back('\0');
  std::string keypoints;
  uint64_t count = 0;
  for (lines->Next(true); lines->HasWord(); ++count) {
    Append(&keypoints, lines->Number<double>("a keypoint"));
    Append(&keypoints, lines->Number<double>("a keypoint"));
    Append(&keypoints, static_cast<uint64_t>(lines->Number<int64_t>("a point's id")));
  }
  Append(bytes, count);
  bytes->append(keypoints);
}

void AppendPoint(LineReader* lines, std::string* bytes) {
  Append(bytes, lines->Number<uint64_t>("a point's id"));
  for (int i = 0; i < 3; ++i) Append(bytes, lines->Number<double>("a position"));
  for (int i = 0; i < 3; ++i) Append(bytes, lines->Number<uint8_t>("a colour"));
  Append(bytes, lines->Number<double>("an error"));
  std::string track;
  uint64_t count = 0;
  for (; lines->HasWord(); ++count) {
    Append(&track, lines->Number<uint32_t>("an image's id"));
    Append(&track, lines->Number<uint32_t>("a keypoint"));
  }
  Append(bytes, count);
  bytes->append(track);
}

std::string NumberText(double value) {
  char text[40];
  return std::string(text, std::to_chars(text, text + sizeof text, value).ptr);
}

void WriteTextFile(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file << text;
  file.close();
  if (file.fail()) throw ResourceError("cannot write it", path, "is the disk full?");
}

}  // namespace

uint64_t CountTextImages(const std::string& text) {
  LineReader lines(text, "");
  uint64_t count = 0;
  for (; lines.Next(false); ++count) lines.Next(true);
  return count;
}

std::string BinaryOfColmapText(const std::string& name, const std::string& text,
                               const std::string& path) {
  LineReader lines(text, path);
  std::string records;
  uint64_t count = 0;
  for (; lines.Next(false); ++count) {
    if (name == "cameras")
      AppendCamera(&lines, &records);
    else if (name == "images")
      AppendImage(&lines, &records);
    else
      AppendPoint(&lines, &records);
  }
  std::string bytes;
  Append(&bytes, count);
  return bytes + records;
}

void WriteColmapText(const ColmapModel& model, const std::string& folder) {
  std::string cameras = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
  for (const ColmapCamera& camera : model.cameras) {
    const ColmapLensInfo& info = InfoOf(camera.lens);
    const Camera& c = camera.intrinsics;
    cameras +=
        Concat(camera.id, " ", info.name, " ", c.width, " ", c.height, " ", NumberText(c.fx));
    if (info.focals == 2) cameras += " " + NumberText(c.fy);
    cameras += " " + NumberText(c.cx) + " " + NumberText(c.cy);
    for (int i = 0; i < info.coefficients; ++i) cameras += " " + NumberText(c.distortion[i]);
    cameras += "\n";
  }
  std::string images =
      "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n# POINTS2D[] as (X, Y, "
      "POINT3D_ID)\n";
  for (const ColmapImage& image : model.images) {
    images += std::to_string(image.id);
    for (const double q : QuaternionOf(image.camera_from_world.rotation))
      images += " " + NumberText(q);
    for (int i = 0; i < 3; ++i)
      images += " " + NumberText(image.camera_from_world.translation[i]);
    images += Concat(" ", image.camera_id, " ", image.name, "\n");
    const char* separator = "";
    for (const ColmapKeypoint& keypoint : image.keypoints) {
      images += Concat(separator, NumberText(keypoint.u), " ", NumberText(keypoint.v), " ",
                       static_cast<int64_t>(keypoint.point_id));
      separator = " ";
    }
    images += "\n";
  }
  std::string points =
      "# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n";
  for (const ColmapPoint& point : model.points) {
    points += std::to_string(point.id);
    for (int i = 0; i < 3; ++i) points += " " + NumberText(point.position[i]);
    for (const uint8_t value : point.color) points += " " + std::to_string(value);
    points += " " + NumberText(point.error);
    for (const ColmapTrackElement& element : point.track)
      points += Concat(" ", element.image_id, " ", element.keypoint);
    points += "\n";
  }
  WriteTextFile(folder + "/cameras.txt", cameras);
  WriteTextFile(folder + "/images.txt", images);
  WriteTextFile(folder + "/points3D.txt", points);
}

}  // namespace regrade
