// Fuzz targets: files of splats; accepted ones are rendered, and their colours written back.
#include <algorithm>
#include <cmath>

#include "kernels/splats/render_picture.h"
#include "pipeline/fields/read_splats.h"
#include "pipeline/fields/restyled_ply.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/support/small_splats.h"
#include "tests/support/splat_bytes.h"

namespace regrade::testing {
namespace {

constexpr uint64_t kBudget = 16 << 20;

Splats Few(int basis) { return CastSplats<float>(RandomSplats(2, basis, 1)); }

std::vector<std::string> PlySeeds() {
  return {PlyOf(Few(1)), PlyOf(Few(4), {"ascii", "float", true, true, ""}),
          PlyOf(Few(4), {"binary_big_endian", "double", false, true, "antialiased 1"}),
          PlyOf(Few(16))};
}

std::vector<std::string> CompressedSeeds() {
  CompressedPlyStyle plain, all;
  plain.packed = {1, 2, 3, 4, ~0u, 1u << 30, 6, 7};
  plain.colors = false;
  all.packed = {8, 9, 10, 11};
  for (int i = 0; i < 18; ++i) {
    const float bound = static_cast<float>(i % 2);
    if (i < 12) plain.chunk.push_back(bound);
    all.chunk.push_back(bound);
  }
  all.degree = 1;
  all.sh = {0, 1, 2, 3, 4, 5, 128, 254, 255};
  return {CompressedPlyOf(plain), CompressedPlyOf(all)};
}

std::vector<std::string> SpzSeeds() {
  SpzSplat splat = {{100, -200, 300}, 200, {1, 2, 3}, {160, 140, 150}, 3u << 30 | 77, {}};
  const std::vector<SpzSplat> plain = {splat, splat};
  splat.sh.assign(9, 140);
  const std::vector<SpzSplat> degree1 = {splat, splat};
  return {UnpackedSpz(2, 0, plain), UnpackedSpz(3, 1, degree1, 3, SpzAxes(7)), SpzOf4(0, plain),
          SpzOf4(1, degree1, 2, SpzAxes(4))};
}

std::vector<std::string> DotSplatSeeds() {
  std::string record;
  for (const float value : {0.1f, -0.2f, 0.3f, 0.1f, 0.2f, 0.3f}) record += LittleEndian(value);
  record += "\xff\x80\x20\xf0\xff\x80\x60\x90";
  return {record, record + record};
}

// Mutants of mutants stay small.
std::string Mutate(std::string file, FuzzRandom* random) {
  file = MutateBytes(std::move(file), random);
  file.resize(std::min<size_t>(file.size(), 8000));
  return file;
}

// A header's mutation is a text's: the rows behind it keep their places.
std::string MutatePly(std::string file, FuzzRandom* random) {
  static const std::vector<std::string> kWords = {"element vertex 2\n",
                                                  "element face 1\n",
                                                  "property float x\n",
                                                  "property double y\n",
                                                  "property list uchar int z\n",
                                                  "property uchar opacity\n",
                                                  "end_header\n",
                                                  "comment\n",
                                                  "ply\n",
                                                  "format ascii 1.0\n",
                                                  "format binary_big_endian 1.0\n",
                                                  "f_rest_9",
                                                  "list",
                                                  "\r"};
  const size_t end = file.find("end_header\n");
  if (end == std::string::npos || random->Chance(0.5)) return Mutate(std::move(file), random);
  const std::string rows = file.substr(end);
  std::string head = MutateText(file.substr(0, end), kWords, random);
  head.resize(std::min<size_t>(head.size(), 8000));
  return head + rows;
}

void Check(const SplatScene& scene, size_t file_bytes) {
  const Splats& splats = scene.splats;
  Validate(splats, "fuzz");
  FuzzRequire(splats.count() > 0, "there is a splat");
  FuzzRequire(scene.records == scene.dropped + splats.count(), "every record is counted");
  FuzzRequire((scene.dropped > 0) == (scene.first_dropped >= 0), "the first dropped is named");
  FuzzRequire(static_cast<uint64_t>(splats.count()) <= 100 * file_bytes, "memory is bounded");
  const SplatPicture<float> picture = RenderSplatsPlain(splats.view(), SplatCameraOf(5, 4), {});
  for (const float value : picture.color)
    FuzzRequire(std::isfinite(value) && value >= 0, "its colours are finite");
}

bool ReadAny(std::string_view bytes) {
  const std::string path = FuzzFile("splats", bytes);
  return Accepts([&] { Check(ReadSplats(path, kBudget), bytes.size()); });
}

bool ReadPly(std::string_view bytes) {
  const std::string path = FuzzFile("splats.ply", bytes);
  return Accepts([&] {
    const SplatScene scene = ReadSplats(path, kBudget);
    Check(scene, bytes.size());
    if (scene.format != SplatFormat::kPly) return;
    std::vector<float> sh(scene.splats.sh.size(), 0.25f);
    try {
      WriteRestyled(path, path + ".out", ColorsOf(sh, scene.splats.basis), "fuzz");
    } catch (const UsageError&) {
      return;  // colours of an integer type
    }
    const SplatScene back = ReadSplats(path + ".out", 2 * kBudget);
    FuzzRequire(back.splats.sh == sh, "colours come back");
    FuzzRequire(back.splats.mean == scene.splats.mean &&
                    back.splats.quaternion == scene.splats.quaternion &&
                    back.records == scene.records,
                "the rest stays");
  });
}

}  // namespace

std::vector<FuzzTarget> SplatTargets() {
  return {{"splat_ply", PlySeeds, ReadPly, MutatePly, 6000},
          {"splat_compressed", CompressedSeeds, ReadAny, MutatePly, 6000},
          {"splat_spz", SpzSeeds, ReadAny, Mutate, 10000},
          {"splat_records", DotSplatSeeds, ReadAny, Mutate, 10000}};
}

}  // namespace regrade::testing
