// Pictures and files made by tests: textured photos, EXIF blocks.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "kernels/base/error.h"
#include "kernels/base/random.h"
#include "kernels/scene/image.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/images/image_file.h"
#include "tests/support/pictures.h"
#include "tests/support/record_error.h"
#include "tests/support/temporary_folder.h"

namespace regrade::testing {

// Smooth waves with some grain, different for each seed, values on the 8-bit grid.
inline Image Photo(int width, int height, uint64_t seed, int channels = 3) {
  Image image(width, height, channels);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c) {
        const uint64_t counter = (static_cast<uint64_t>(y) * width + x) * channels + c;
        const double wave = 0.5 + 0.35 * std::sin(0.05 * x * (c + 1) + 0.03 * y + seed);
        const double value = wave + 0.1 * (RandomDouble(seed, 0, counter) - 0.5);
        image.at(x, y)[c] = static_cast<float>(std::floor(value * 255 + 0.5) / 255);
      }
  return image;
}

inline std::string Little(uint64_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i, value >>= 8) text += static_cast<char>(value & 255);
  return text;
}

// An entry of a little-endian TIFF directory; types: 3 short, 4 long, 5 rational.
inline std::string TiffEntry(int tag, int type, uint32_t count, uint32_t value) {
  return Little(tag, 2) + Little(type, 2) + Little(count, 4) + Little(value, 4);
}

// An EXIF block: orientation, focal length in 35 mm film (0: none), else focal length in mm and
// pixels per cm on the sensor (0: none).
inline std::string ExifBlock(int orientation, int focal_35mm, int focal_mm = 0,
                             int sensor_px_per_cm = 0) {
  std::string tiff = std::string("II*\0", 4) + Little(8, 4);
  const uint32_t sub = 8 + 2 + 2 * 12 + 4;
  tiff += Little(2, 2) + TiffEntry(0x0112, 3, 1, orientation) + TiffEntry(0x8769, 4, 1, sub) +
          Little(0, 4);
  const uint32_t rationals = sub + 2 + 4 * 12 + 4;
  tiff += Little(4, 2) + TiffEntry(0x920a, 5, 1, rationals) +
          TiffEntry(0xa20e, 5, 1, rationals + 8) + TiffEntry(0xa210, 3, 1, 3) +
          TiffEntry(0xa405, 3, 1, focal_35mm) + Little(0, 4);
  tiff += Little(focal_mm, 4) + Little(1, 4) + Little(sensor_px_per_cm, 4) + Little(1, 4);
  return std::string("Exif\0\0", 6) + tiff;
}

// An EXIF block of a place: degrees, minutes and hundredths of a second; meters.
inline std::string GpsBlock(char north, const std::array<int, 3>& latitude, char east,
                            const std::array<int, 3>& longitude, bool below, int altitude) {
  const auto fractions = [](const std::array<int, 3>& angle) {
    return Little(angle[0], 4) + Little(1, 4) + Little(angle[1], 4) + Little(1, 4) +
           Little(angle[2], 4) + Little(100, 4);
  };
  const uint32_t gps = 8 + 2 + 12 + 4, values = gps + 2 + 6 * 12 + 4;
  return std::string("Exif\0\0II*\0", 10) + Little(8, 4) + Little(1, 2) +
         TiffEntry(0x8825, 4, 1, gps) + Little(0, 4) + Little(6, 2) +
         TiffEntry(1, 2, 2, north) + TiffEntry(2, 5, 3, values) + TiffEntry(3, 2, 2, east) +
         TiffEntry(4, 5, 3, values + 24) + TiffEntry(5, 1, 1, below) +
         TiffEntry(6, 5, 1, values + 48) + Little(0, 4) + fractions(latitude) +
         fractions(longitude) + Little(altitude, 4) + Little(1, 4);
}

// A JPEG with the segment inserted after its first two bytes.
inline std::string WithSegment(const std::string& jpeg, int marker, const std::string& body) {
  std::string segment = "\xff";
  segment += static_cast<char>(marker);
  segment += static_cast<char>((body.size() + 2) >> 8);
  segment += static_cast<char>((body.size() + 2) & 255);
  return jpeg.substr(0, 2) + segment + body + jpeg.substr(2);
}

// A chunk of PNG: `body` begins with its name.
inline std::string PngChunk(const std::string& body) {
  uint32_t crc = ~0u;
  for (const char c : body) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0u);
  }
  const auto big = [](uint32_t v) {
    std::string text;
    for (int shift = 24; shift >= 0; shift -= 8) text += static_cast<char>(v >> shift);
    return text;
  };
  return big(static_cast<uint32_t>(body.size()) - 4) + body + big(~crc);
}

// A PNG with the chunk inserted before the pixels, or after them.
inline std::string WithChunk(const std::string& png, const std::string& body) {
  return std::string(png).insert(8 + 12 + 13, PngChunk(body));
}
inline std::string WithLateChunk(const std::string& png, const std::string& body) {
  return std::string(png).insert(png.size() - 12, PngChunk(body));
}

// A WebP of chunks: names of four letters and bodies. The canvas is given to the chunk VP8X.
inline std::string WebpOf(int width, int height,
                          const std::vector<std::pair<std::string, std::string>>& chunks) {
  std::string body = "WEBPVP8X" + Little(10, 4) + Little(0x28, 4) + Little(width - 1, 3) +
                     Little(height - 1, 3);
  for (const auto& [name, bytes] : chunks)
    body += name + Little(bytes.size(), 4) + bytes + std::string(bytes.size() % 2, '\0');
  return "RIFF" + Little(body.size(), 4) + body;
}

// A plain TIFF of floats, `channels` samples a pixel.
inline std::string FloatTiff(const Image& image) {
  const std::string data(reinterpret_cast<const char*>(image.pixels.data()),
                         image.pixels.size() * sizeof(float));
  constexpr uint32_t kData = 8 + 2 + 10 * 12 + 4;
  std::string tiff = std::string("II*\0", 4) + Little(8, 4) + Little(10, 2);
  tiff += TiffEntry(256, 4, 1, image.width) + TiffEntry(257, 4, 1, image.height) +
          TiffEntry(258, 3, 1, 32) + TiffEntry(259, 3, 1, 1) +
          TiffEntry(262, 3, 1, image.channels == 1 ? 1 : 2) + TiffEntry(273, 4, 1, kData) +
          TiffEntry(277, 3, 1, image.channels) + TiffEntry(278, 4, 1, image.height) +
          TiffEntry(279, 4, 1, static_cast<uint32_t>(data.size())) + TiffEntry(339, 3, 1, 3) +
          Little(0, 4);
  return tiff + data;
}

// The reason of a refusal; "" if the photo was decoded.
inline std::string Refusal(const std::string& path, const DecodeLimits& limits = {}) {
  static std::map<std::string, int> count;  // of this test
  const std::string test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
  try {
    DecodePhoto(path, limits);
    RecordCount("pictures read", ++count[test + " read"]);
    return "";
  } catch (const Error& error) {
    RecordCount("pictures refused by name", ++count[test + " refused"]);
    EXPECT_EQ(error.code(), ExitCode::kInput);
    EXPECT_EQ(error.where(), path);
    return error.what_failed();
  }
}

// A test with a scratch folder.
class PictureTest : public ::testing::Test {
 protected:
  std::string Put(const std::string& name, const std::string& bytes) {
    WriteText(scratch_ / name, bytes);
    return scratch_ / name;
  }
  TemporaryFolder scratch_;
};

// Why a photo is not used.
inline std::string WhyNot(const IngestResult& result, const std::string& file) {
  for (const PhotoStatus& photo : result.statuses)
    if (photo.file == file) return photo.status == PhotoState::kUsed ? "used" : photo.why;
  return "not listed";
}

}  // namespace regrade::testing
