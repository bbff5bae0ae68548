#include "pipeline/images/cube_file.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "kernels/base/error.h"
#include "kernels/base/number_text.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/text.h"
#include "pipeline/images/image_file.h"

namespace regrade {
namespace {

constexpr uint64_t kMostBytes = uint64_t{256} << 20;
constexpr double kLargestValue = 100, kSmallestDomain = 1e-3;

class CubeParser {
 public:
  CubeParser(std::string_view text, const std::string& path) : text_(text), path_(path) {}

  ColorLut Parse() {
    while (NextLine()) {
      const std::string_view first = Word();
      if (first.empty() || first[0] == '#') continue;
      const bool is_keyword = (first[0] >= 'A' && first[0] <= 'Z');
      if (!is_keyword) {
        Colour(first);
      } else if (!values_.empty()) {
        Fail("has '" + Shown(first) + "' after the first colour");
      } else {
        Keyword(first);
      }
    }
    if (table_size_ == 0 && curve_size_ == 0) FailWhole("has no LUT_3D_SIZE or LUT_1D_SIZE");
    if (values_.size() != Expected())
      FailWhole(Concat("has ", values_.size(), " colours, and its size asks for ", Expected()));
    ColorLut lut;
    lut.title = title_;
    if (table_size_ > 0)
      lut.table = {table_size_, low_, high_, std::move(values_)};
    else
      lut.curves = {low_, high_, std::move(values_)};
    return lut;
  }

 private:
  static constexpr const char* kHint =
      "export it again as a .cube file, from any program that writes LUTs";
  static std::string Shown(std::string_view word) { return Printable(word.substr(0, 40)); }

  [[noreturn]] void FailWhole(const std::string& why) const {
    throw InputError(why, path_, kHint);
  }
  [[noreturn]] void Fail(const std::string& why) const {
    throw InputError(Concat("line ", number_, " ", why), path_, kHint);
  }

  bool NextLine() {
    if (position_ >= text_.size()) return false;
    const size_t end = std::min(text_.find_first_of("\r\n", position_), text_.size());
    line_ = text_.substr(position_, end - position_);
    position_ = end + 1;
    // A line may end with both, in this order.
    if (end + 1 < text_.size() && text_[end] == '\r' && text_[end + 1] == '\n') ++position_;
    ++number_;
    return true;
  }
  std::string_view Word() {
    line_.remove_prefix(std::min(line_.find_first_not_of(" \t"), line_.size()));
    const std::string_view word = line_.substr(0, line_.find_first_of(" \t"));
    line_.remove_prefix(word.size());
    return word;
  }
  void End() {
    if (const std::string_view more = Word(); !more.empty() && more[0] != '#')
      Fail("has '" + Shown(more) + "' after its last number");
  }
  double Number(std::string_view word) const {
    if (word.empty()) Fail("ends before its last number");
    double value = 0;
    if (!ParseNumber(word, &value)) Fail("has '" + Shown(word) + "' in place of a number");
    if (!(std::abs(value) <= kLargestValue))
      Fail("has the number " + Shown(word) + ", beyond -100 to 100");
    return value;
  }
  int Size(int most) {
    const std::string_view word = Word();
    int value = 0;
    if (!ParseNumber(word, &value) || value < 2 || value > most)
      Fail(Concat("has the size '", Shown(word), "', not one from 2 to ", most));
    if (table_size_ > 0 || curve_size_ > 0)
      Fail("has a second size: one table or one set of curves can be read, not both");
    End();
    return value;
  }
  Vec3d Three(std::string_view first) {
    Vec3d value;
    value.x = Number(first);
    value.y = Number(Word());
    value.z = Number(Word());
    End();
    return value;
  }
  void CheckDomain() const {
    for (int c = 0; c < 3; ++c)
      if (!(high_[c] - low_[c] >= kSmallestDomain)) Fail("leaves an empty domain");
  }
  void Domain(std::string_view keyword) {
    if (keyword == "DOMAIN_MIN" || keyword == "DOMAIN_MAX") {
      (keyword == "DOMAIN_MIN" ? low_ : high_) = Three(Word());
    } else {
      const double low = Number(Word()), high = Number(Word());
      End();
      low_ = {low, low, low};
      high_ = {high, high, high};
    }
  }
  void Keyword(std::string_view keyword) {
    if (keyword == "TITLE") {
      line_.remove_prefix(std::min(line_.find_first_not_of(" \t\""), line_.size()));
      title_ = Printable(line_.substr(0, line_.find_last_not_of(" \t\"") + 1).substr(0, 200));
    } else if (keyword == "LUT_3D_SIZE") {
      table_size_ = Size(kMostTableSize);
    } else if (keyword == "LUT_1D_SIZE") {
      curve_size_ = Size(kMostCurveSize);
    } else if (keyword == "DOMAIN_MIN" || keyword == "DOMAIN_MAX" ||
               keyword == "LUT_3D_INPUT_RANGE" || keyword == "LUT_1D_INPUT_RANGE") {
      Domain(keyword);
    } else {
      Fail("has the unknown keyword '" + Shown(keyword) + "'");
    }
  }
  size_t Expected() const {
    const size_t n = static_cast<size_t>(table_size_);
    return table_size_ > 0 ? n * n * n : static_cast<size_t>(curve_size_);
  }
  void Colour(std::string_view first) {
    if (table_size_ == 0 && curve_size_ == 0)
      Fail("has a colour or something unknown before LUT_3D_SIZE and LUT_1D_SIZE");
    if (values_.empty()) CheckDomain();
    if (values_.size() == Expected()) Fail("has one colour more than the size asks for");
    values_.push_back(Three(first).Cast<float>());
  }

  std::string_view text_, line_;
  const std::string& path_;
  size_t position_ = 0;
  int64_t number_ = 0;
  std::string title_;
  int table_size_ = 0, curve_size_ = 0;
  Vec3d low_{0, 0, 0}, high_{1, 1, 1};
  std::vector<Vec3f> values_;
};

}  // namespace

std::string SlopeText(const ColorLut& lut) {
  const double slope = lut.Slope();
  const std::string text =
      Format("the LUT magnifies differences of colours at most %.2f times", slope);
  if (slope <= kHarmlessSlope) return text + ", which is harmless";
  return text + Format(
                    ", more than %.0f: it magnifies noise and the steps of 8-bit photos as "
                    "much, which show as grain and bands; smooth it in the program that made "
                    "it, or lower --strength",
                    kHarmlessSlope);
}

void RefuseOtherLooks(const std::string& path) {
  const std::string extension = LowerExtension(path);
  for (const char* other : {".xmp", ".dtstyle", ".lrtemplate", ".dcp", ".icc", ".3dl", ".look",
                            ".csp", ".vlt", ".costyle", ".pp3"})
    if (extension == other)
      throw InputError(
          "is a look of another program, which only that program can apply", path,
          "export it as a LUT with the ending .cube: Lightroom, Capture One and Resolve do so "
          "themselves or by a plug-in; in darktable and RawTherapee apply it to an identity "
          "LUT picture (Hald) and convert that. Or retouch one photo with it: GUIDE.md, Your "
          "own retouching");
}

ColorLut ParseCube(std::string_view text, const std::string& path) {
  return CubeParser(WithoutByteOrderMark(text), path).Parse();
}

ColorLut ReadCubeFile(const std::string& path) {
  return ParseCube(ReadWholeFile(path, kMostBytes), path);
}

std::string CubeText(const ColorTable& table, const std::string& title) {
  std::string text =
      "TITLE \"" + title + "\"\nLUT_3D_SIZE " + std::to_string(table.size) + "\n";
  text += "DOMAIN_MIN 0 0 0\nDOMAIN_MAX 1 1 1\n";
  for (const Vec3f& v : table.values)
    text += Format("%.6f %.6f %.6f\n", double{v.x}, double{v.y}, double{v.z});
  return text;
}

Image LutChart(const ColorLut& lut) {
  Image chart(360, 240);
  for (int y = 0; y < chart.height; ++y) {
    for (int x = 0; x < chart.width; ++x) {
      // Full hues above, from white to black; greys in the lowest eighth.
      const double down = y / (0.875 * chart.height);
      Vec3d color;
      for (int c = 0; c < 3; ++c) {
        const double turn = std::fmod(x / 60.0 + (c == 0 ? 0 : c == 1 ? 4 : 2), 6);
        const double hue = std::clamp(std::abs(turn - 3) - 1, 0.0, 1.0);
        color[c] = down > 1     ? x / (chart.width - 1.0)
                   : down < 0.5 ? 1 - 2 * down * (1 - hue)
                                : hue * 2 * (1 - down);
      }
      const Vec3d mapped = lut(color);
      for (int c = 0; c < 3; ++c)
        chart.at(x, y)[c] = static_cast<float>(std::clamp(mapped[c], 0.0, 1.0));
    }
  }
  return chart;
}

Image StyleExample(const std::string& path, std::string* notice) {
  RefuseOtherLooks(path);
  if (IsCubeFile(path)) return LutChart(ReadCubeFile(path));
  return ReadStylePicture(path, notice);
}

}  // namespace regrade
