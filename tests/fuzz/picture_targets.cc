// Fuzz targets: recognition of formats, whole pictures, colour profiles, films, and text drawn
// into pictures.
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>

#include "pipeline/images/color_profile.h"
#include "pipeline/images/draw_text.h"
#include "pipeline/images/image_file.h"
#include "pipeline/images/image_format.h"
#include "pipeline/images/video_reader.h"
#include "pipeline/images/video_writer.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

Image Waves(int width, int height) {
  Image image(width, height, 3);
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = 0.5f + 0.5f * std::sin(0.3f * static_cast<float>(i));
  return image;
}

// --- the format, by the first bytes

std::vector<std::string> FormatSeeds() {
  using std::string_literals::operator""s;
  return {"\xff\xd8\xff\xe0"s, "\x89PNG\r\n\x1a\n"s,
          "\0\0\0\x18"
          "ftypheic"s,
          // A TIFF directory of two entries, the second DNG's version.
          "II*\0\x08\0\0\0\x02\0\0\x01\x03\0\1\0\0\0\x40\0\0\0\x12\xc6\1\0\4\0\0\0\1\4\0\0"s,
          "MM\0*\0\0\0\x08\0\1\x01\0\0\3\0\0\0\1\0\x40\0\0"s};
}

bool ReadFormat(std::string_view bytes) {
  // An exact copy: sanitizers see reads beyond it.
  const std::vector<char> own(bytes.begin(), bytes.end());
  const ImageFormat* format = nullptr;
  for (const char* name : {"a.jpg", "a.nef"})
    format = SniffImageFormat({own.data(), own.size()}, name);
  if (format == nullptr) return false;
  FuzzRequire(format->name[0] != '\0', "a format has a name");
  return true;
}

std::string Mutate(std::string bytes, FuzzRandom* random) {
  return MutateBytes(std::move(bytes), random);
}

// --- PNG

constexpr size_t kSignature = 8;

// Corrects the checksums of all chunks that their lengths lead to.
std::string MutatePng(std::string bytes, FuzzRandom* random) {
  bytes = MutateBytes(std::move(bytes), random);
  if (random->Chance(0.3)) return bytes;
  const auto big = [&bytes](size_t at) {
    size_t value = 0;
    for (size_t i = 0; i < 4; ++i)
      value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  for (size_t at = kSignature; at + 12 <= bytes.size() && big(at) <= bytes.size() - at - 12;
       at += 12 + big(at)) {
    uLong crc = crc32(0, reinterpret_cast<const Bytef*>(&bytes[at + 4]),
                      static_cast<uInt>(4 + big(at)));
    for (size_t i = 4; i-- > 0; crc >>= 8)
      bytes[at + 8 + big(at) + i] = static_cast<char>(crc & 255);
  }
  return bytes;
}

// --- whole pictures

std::vector<std::string> PhotoSeeds() {
  return {EncodePng8(Waves(12, 9)), EncodeJpeg(Waves(16, 16), 90), EncodePng16(Waves(5, 7))};
}

bool ReadPhoto(std::string_view bytes) {
  // JPEG and PNG only: the formats of our own decoders.
  if (bytes.substr(0, 3) != "\xff\xd8\xff" && bytes.substr(0, 8) != "\x89PNG\r\n\x1a\n")
    return false;
  const std::string path = FuzzFile("photo", bytes);
  return Accepts([&path] {
    const DecodedPhoto photo = DecodePhoto(path, {.max_pixels = 1 << 20, .min_side = 1});
    FuzzRequire(photo.image.channels == 3 || photo.image.channels == 4, "RGB, or with alpha");
    FuzzRequire(photo.image.num_pixels() <= 1 << 20, "no larger than the limit");
    for (const float value : photo.image.pixels)
      FuzzRequire(value >= 0 && value <= 1, "values in [0, 1]");
  });
}

std::string MutatePhoto(std::string bytes, FuzzRandom* random) {
  return bytes[0] == '\x89' ? MutatePng(std::move(bytes), random)
                            : MutateBytes(std::move(bytes), random);
}

// --- colour profiles

std::vector<std::string> ProfileSeeds() { return {AdobeRgbProfile()}; }

bool ReadProfile(std::string_view bytes) {
  Image image = Waves(4, 3);
  std::string problem;
  const std::string name = LinearizeByProfile(bytes, &image, &problem);
  FuzzRequire(problem.empty() || name.empty(), "applied or refused");
  if (!problem.empty()) FuzzRequire(image.pixels == Waves(4, 3).pixels, "refused: unchanged");
  return problem.empty();
}

// --- films

std::vector<std::string> FilmSeeds() {
  const std::string path = FuzzFolder() + "/seed.mp4";
  VideoWriter film(path, 32, 16, 25);
  for (int i = 0; i < 3; ++i) film.Add(Waves(32, 16));
  film.Finish();
  std::ifstream file(path, std::ios::binary);
  return {{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()}};
}

bool ReadFilm(std::string_view bytes) {
  const std::string path = FuzzFile("film", bytes);
  return Accepts([&path] {
    VideoReader reader(path, {.max_pixels = 1 << 16, .max_seconds = 60, .max_frames = 50});
    double last = 0;
    while (reader.Next()) {
      FuzzRequire(reader.seconds() >= last && reader.seconds() <= 60, "times go on");
      last = reader.seconds();
      const Image picture = reader.Picture();
      FuzzRequire(picture.width == reader.info().width && picture.channels == 3 &&
                      picture.height == reader.info().height,
                  "of the size that the header says");
      FuzzRequire(reader.Grey(8).width <= 8, "scaled down");
    }
  });
}

// --- text in pictures: four numbers, then the text

std::vector<std::string> TextSeeds() {
  return {std::string("\x02\0\x05\0\x28\0\x03", 7) + "source gap 1",
          std::string(8, '\0') + "x"};
}

bool Draw(std::string_view bytes) {
  if (bytes.size() < 7) return false;
  const auto number = [bytes](size_t at) {
    return static_cast<int16_t>(static_cast<unsigned char>(bytes[at]) |
                                static_cast<unsigned char>(bytes[at + 1]) << 8);
  };
  Image picture(60, 40, 3);
  const double size = 0.25 * (1 + static_cast<unsigned char>(bytes[6]) % 16);
  DrawText(&picture, number(0), number(2), std::max<int>(0, number(4)),
           std::string(bytes.substr(7, 200)), size, 1);
  for (const float value : picture.pixels)
    FuzzRequire(value >= 0 && value <= 1, "a picture stays a picture");
  return true;
}

}  // namespace

std::vector<FuzzTarget> PictureTargets() {
  return {{"image_format", FormatSeeds, ReadFormat, Mutate, 100000},
          {"photo", PhotoSeeds, ReadPhoto, MutatePhoto, 40000},
          {"color_profile", ProfileSeeds, ReadProfile, Mutate, 8000},
          {"film", FilmSeeds, ReadFilm, Mutate, 1000},
          {"picture_text", TextSeeds, Draw, Mutate, 8000}};
}

}  // namespace regrade::testing
