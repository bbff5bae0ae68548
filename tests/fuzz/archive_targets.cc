// Fuzz targets: .npz files and .npy headers.
#include "pipeline/files/npz_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/stored_zip.h"
#include "tests/support/small_archive.h"

namespace regrade::testing {
namespace {

constexpr uint64_t kBudget = 4 << 20;

// The second is not compressed: mutants of its arrays keep correct checksums.
std::vector<std::string> ArchiveSeeds() {
  const std::string archive = SmallArchive();
  return {archive, StoredCopyOfNpz(FuzzFile("seed.npz", archive))};
}

bool ReadArrays(std::string_view bytes) {
  const std::string path = FuzzFile("a.npz", bytes);
  return Accepts([&path] {
    NpzReader reader(path, kBudget);
    for (const std::string& name : reader.names()) {
      const NpzArray array = reader.Read(name);
      FuzzRequire(array.bytes.size() == array.num_elements() * SizeOf(array.type),
                  "a shape has its bytes");
    }
  });
}

std::vector<std::string> HeaderSeeds() {
  return {MakeNpyHeader(ArrayType::kF32, {3, 4}), MakeNpyHeader(ArrayType::kU8, {}),
          MakeNpyHeader(ArrayType::kF64, {20, 17})};
}

bool ReadHeader(std::string_view bytes) {
  return Accepts([bytes] {
    const NpyHeader header = ParseNpyHeader(bytes, "fuzz.npy");
    FuzzRequire(header.data_offset <= bytes.size(), "the data begins inside of the file");
    FuzzRequire(header.shape.size() <= 8, "no more than 8 axes");
    const NpyHeader again = ParseNpyHeader(MakeNpyHeader(header.type, header.shape), "again");
    FuzzRequire(again.shape == header.shape && again.data_bytes == header.data_bytes,
                "a round trip keeps type and shape");
  });
}

}  // namespace

std::vector<FuzzTarget> ArchiveTargets() {
  return {{"npz", ArchiveSeeds, ReadArrays, MutateNpz, 30000},
          {"npy_header", HeaderSeeds, ReadHeader, MutateNpy, 50000}};
}

}  // namespace regrade::testing
