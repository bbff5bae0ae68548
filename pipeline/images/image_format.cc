#include "pipeline/images/image_format.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>

namespace regrade {
namespace {

constexpr char kConvert[] = "convert it to JPEG (or 16-bit TIFF) first";

const ImageFormat kJpeg = {"JPEG", "jpeg"};
const ImageFormat kTiff = {"TIFF", "tiff"};
const ImageFormat kHeic = {"HEIC", "heif", true, kConvert};
const ImageFormat kAvif = {"AVIF", "heif", true, kConvert};
const ImageFormat kRaw = {"camera raw", "raw", false, kConvert};
const ImageFormat kJpegXl = {"JPEG XL", "", true, kConvert};
const ImageFormat kVideo = {"video", "", true,
                            "give the film, or a folder with it, to `regrade run`, which "
                            "picks frames; elsewhere extract one as a picture"};

struct Signature {
  std::string_view bytes;
  size_t offset;
  ImageFormat format;
};

using namespace std::string_view_literals;
const Signature kSignatures[] = {
    {"\x89PNG\r\n\x1a\n"sv, 0, {"PNG", "png"}},
    {"\x76\x2f\x31\x01"sv, 0, {"OpenEXR", "openexr"}},
    {"WEBP"sv, 8, {"WebP", "webp"}},
    {"GIF87a"sv, 0, {"GIF", "gif"}},
    {"GIF89a"sv, 0, {"GIF", "gif"}},
    {"BM"sv, 0, {"BMP", "bmp"}},
    {"#?RADIANCE"sv, 0, {"Radiance HDR", "hdr"}},
    {"#?RGBE"sv, 0, {"Radiance HDR", "hdr"}},
    {"8BPS"sv, 0, {"Photoshop", "psd"}},
    {"\0\0\0\x0cjP  \r\n\x87\n"sv, 0, {"JPEG 2000", "jpeg2000"}},
    {"\xff\x4f\xff\x51"sv, 0, {"JPEG 2000", "jpeg2000"}},
    {"P5\n"sv, 0, {"PGM", "pnm"}},
    {"P6\n"sv, 0, {"PPM", "pnm"}},
    {"P5 "sv, 0, {"PGM", "pnm"}},  // any white space may follow
    {"P6 "sv, 0, {"PPM", "pnm"}},
    {"\xff\x0a"sv, 0, kJpegXl},
    {"\0\0\0\x0cJXL \r\n\x87\n"sv, 0, kJpegXl},
    {"FUJIFILMCCD-RAW"sv, 0, kRaw},
    {"IIRO"sv, 0, kRaw},
    {"IIRS"sv, 0, kRaw},
    {"MMOR"sv, 0, kRaw},
    {"IIU\0"sv, 0, kRaw},
    {"\x1a\x45\xdf\xa3"sv, 0, kVideo},
    {"AVI "sv, 8, kVideo},
    {"moov"sv, 4, kVideo},  // QuickTime of older cameras begins without a brand
    {"mdat"sv, 4, kVideo},
    {"wide"sv, 4, kVideo},
    {"\0\0\x01\xba"sv, 0, kVideo},  // MPEG program stream
};

bool HasAt(std::string_view bytes, size_t offset, std::string_view what) {
  return bytes.size() >= offset + what.size() && bytes.substr(offset, what.size()) == what;
}

// MPEG transport streams have packets of 188 bytes, on discs with 4 bytes before each.
bool IsTransportStream(std::string_view bytes) {
  for (const size_t before : {0, 4}) {
    bool all = true;
    for (size_t i = 0; i < 4; ++i) all = all && HasAt(bytes, before + i * (188 + before), "G");
    if (all) return true;
  }
  return false;
}

// Camera makers' raw formats are TIFF files whose first picture is a thumbnail: reading them as
// TIFF would succeed with the wrong picture.
bool TiffIsCameraRaw(std::string_view bytes, const std::string& path) {
  if (HasAt(bytes, 8, "CR")) return true;  // Canon CR2
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  for (const char* raw : {".dng", ".nef", ".nrw", ".arw", ".sr2", ".srf", ".pef", ".srw",
                          ".rwl", ".3fr", ".iiq", ".erf", ".kdc", ".dcr", ".mos"})
    if (extension == raw) return true;
  // A DNG under another name has the tag DNGVersion in its first directory.
  const bool little = bytes[0] == 'I';
  const auto read = [&](size_t at, int size) -> uint64_t {
    uint64_t value = 0;
    for (int i = 0; i < size; ++i)
      value |= static_cast<uint64_t>(static_cast<unsigned char>(bytes[at + i]))
               << (8 * (little ? i : size - 1 - i));
    return value;
  };
  if (bytes.size() < 8) return false;
  const uint64_t directory = read(4, 4);
  if (directory + 2 > bytes.size()) return false;
  const uint64_t count = read(directory, 2);
  for (uint64_t i = 0; i < count && directory + 2 + 12 * (i + 1) <= bytes.size(); ++i)
    if (read(directory + 2 + 12 * i, 2) == 0xc612) return true;
  return false;
}

// The first box of a file of the ISO base media family names its format.
const ImageFormat* SniffBrand(std::string_view bytes) {
  const std::string_view brand = bytes.substr(8, 4);
  for (const char* heic : {"heic", "heix", "heim", "heis", "hevc", "mif1", "msf1"})
    if (brand == heic) return &kHeic;
  if (brand == "avif" || brand == "avis") return &kAvif;
  if (brand == "crx ") return &kRaw;
  return &kVideo;
}

}  // namespace

const ImageFormat* SniffImageFormat(std::string_view bytes, const std::string& path) {
  if (HasAt(bytes, 0, "\xff\xd8\xff")) return &kJpeg;
  if (HasAt(bytes, 0, "II*\0"sv) || HasAt(bytes, 0, "MM\0*"sv) || HasAt(bytes, 0, "II+\0"sv) ||
      HasAt(bytes, 0, "MM\0+"sv))
    return TiffIsCameraRaw(bytes, path) ? &kRaw : &kTiff;
  if (HasAt(bytes, 4, "ftyp") && bytes.size() >= 12) return SniffBrand(bytes);
  for (const Signature& signature : kSignatures)
    if (HasAt(bytes, signature.offset, signature.bytes)) return &signature.format;
  return IsTransportStream(bytes) ? &kVideo : nullptr;
}

bool IsVideo(const ImageFormat& format) { return format.name == std::string_view("video"); }
bool IsCameraRaw(const ImageFormat& format) {
  return format.decoder == std::string_view("raw");
}

}  // namespace regrade
