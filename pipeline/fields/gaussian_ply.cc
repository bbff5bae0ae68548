#include "pipeline/fields/gaussian_ply.h"

#include <algorithm>
#include <utility>

#include "kernels/base/error.h"
#include "kernels/base/parallel_tasks.h"
#include "pipeline/files/text.h"

namespace regrade {
namespace {

// Of GaussianLayout::property.
std::vector<std::string> NamesFor(int basis) {
  std::vector<std::string> names = {"x",     "y",     "z",     "scale_0", "scale_1", "scale_2",
                                    "rot_0", "rot_1", "rot_2", "rot_3",   "opacity"};
  for (int channel = 0; channel < 3; ++channel) {
    names.push_back(Concat("f_dc_", channel));
    for (int k = 0; k < basis - 1; ++k)
      names.push_back(Concat("f_rest_", channel * (basis - 1) + k));
  }
  return names;
}

int BasisFor(size_t rest, const std::string& where) {
  for (int degree = 0; degree <= 3; ++degree)
    if (rest == static_cast<size_t>(3 * (BasisOfDegree(degree) - 1)))
      return BasisOfDegree(degree);
  throw InputError(
      Concat(rest, " properties f_rest_*; 0, 9, 24 or 45 are read (degrees 0 to 3)"), where,
      "reduce the degree (`splat-transform --filter-harmonics 3`)");
}

void NameWhatIsIgnored(const PlyHeader& header, const GaussianLayout& layout,
                       std::vector<std::string>* ignored) {
  const std::vector<PlyProperty>& properties = header.elements[layout.vertex].properties;
  std::vector<bool> used(properties.size());
  for (const size_t i : layout.property) used[i] = true;
  for (size_t i = 0; i < properties.size(); ++i) {
    const std::string& name = properties[i].name;
    // Normals, which the layout has for other programs' sake, are 0.
    if (!used[i] && name != "nx" && name != "ny" && name != "nz")
      ignored->push_back("property " + Printable(name));
  }
  for (size_t i = 0; i < header.elements.size(); ++i)
    if (i != layout.vertex) ignored->push_back("element " + Printable(header.elements[i].name));
}

// Of the next `count` rows.
std::vector<ColoredSplat> NextRecords(PlyRows* rows, const GaussianLayout& layout,
                                      uint64_t count) {
  std::vector<ColoredSplat> records(count);
  const auto read = [&](PlyRows* from, uint64_t begin, uint64_t end) {
    for (uint64_t i = begin; i < end; ++i) {
      from->Next();
      records[i] = RecordOf(*from, layout);
    }
  };
  if (!rows->have_one_length()) {
    read(rows, 0, count);
    return records;
  }
  constexpr uint64_t kPart = 1024;
  ParallelTasks(0, static_cast<int64_t>((count + kPart - 1) / kPart), [&](int64_t part) {
    const uint64_t begin = kPart * static_cast<uint64_t>(part);
    PlyRows own = *rows;
    own.Skip(begin);
    read(&own, begin, std::min(count, begin + kPart));
  });
  rows->Skip(count);
  return records;
}

}  // namespace

GaussianLayout FindGaussians(const PlyHeader& header, const std::string& where) {
  const std::optional<size_t> vertex = header.Find("vertex");
  if (!vertex)
    throw InputError("a PLY without an element 'vertex'", where,
                     "export the splats as PLY from the program that fitted them");
  const PlyElement& element = header.elements[*vertex];
  GaussianLayout layout;
  layout.vertex = *vertex;
  const auto rest = std::ranges::count_if(element.properties, [](const PlyProperty& property) {
    return property.name.starts_with("f_rest_");
  });
  layout.basis = BasisFor(static_cast<size_t>(rest), where);
  std::vector<std::string> missing;
  for (const std::string& name : NamesFor(layout.basis)) {
    const std::optional<size_t> found = element.Find(name);
    if (!found || element.properties[*found].count_type) missing.push_back(name);
    layout.property.push_back(found.value_or(0));
  }
  if (!missing.empty())
    throw InputError("its vertices are no splats: they lack " + Join(missing, ", "), where,
                     "a cloud of points or a mesh is not read here; export the splats as PLY "
                     "from the program that fitted them");
  return layout;
}

ColoredSplat RecordOf(const PlyRows& rows, const GaussianLayout& layout) {
  float v[kFirstHarmonic + 3 * kMaxBasis];
  std::ranges::transform(layout.property, v, [&rows](size_t property) {
    return static_cast<float>(rows.Number(property));
  });
  ColoredSplat record;
  record.splat = {{v[0], v[1], v[2]}, {v[3], v[4], v[5]}, {v[6], v[7], v[8], v[9]}, v[10]};
  std::copy_n(v + kFirstHarmonic, 3 * layout.basis, record.sh);
  return record;
}

SplatScene ReadGaussianPly(std::string_view bytes, const PlyHeader& header, uint64_t budget,
                           const std::string& where) {
  const GaussianLayout layout = FindGaussians(header, where);
  const uint64_t count = header.elements[layout.vertex].count;
  PlyRows rows(bytes, header, layout.vertex, where);
  SplatCollector collector(count, layout.basis, bytes.size(), budget, where);
  constexpr uint64_t kAtOnce = 1 << 16;
  for (uint64_t i = 0; i < count; i += kAtOnce)
    for (const ColoredSplat& record : NextRecords(&rows, layout, std::min(kAtOnce, count - i)))
      collector.Add(record);
  SplatScene scene = std::move(collector).Finish();
  scene.format = SplatFormat::kPly;
  scene.antialiased = SaysAntialiased(header);
  NameWhatIsIgnored(header, layout, &scene.ignored);
  if (layout.vertex + 1 == header.elements.size() &&
      rows.left().find_first_not_of(" \t\r\n") != std::string_view::npos)
    scene.notes.push_back(
        Concat(rows.left().size(), " bytes after the last splat are left out"));
  return scene;
}

bool SaysAntialiased(const PlyHeader& header) {
  bool antialiased = false;
  for (const std::string& comment : header.comments) {
    const std::string text = LowerCase(comment);
    const size_t begin = std::min(text.find_first_not_of(' '), text.size());
    const size_t end = text.find_last_not_of(' ') + 1;
    const std::string words = begin < end ? text.substr(begin, end - begin) : "";
    if (words.starts_with("splatrendermode:")) antialiased = words.ends_with(" mip");
    if (words == "antialiased 1" || words == "antialiased 0") antialiased = words.back() == '1';
  }
  return antialiased;
}

std::string CommentLines(const std::string& comment, bool antialiased) {
  return "comment " + comment + "\n" + (antialiased ? "comment SplatRenderMode: mip\n" : "");
}

}  // namespace regrade
