// validation_tool FIELD.npz [SPARSE]: prints the seconds of reading a field, of its validation
// alone, and of reading a COLMAP model.
#include <chrono>
#include <cstdio>

#include "pipeline/fields/field_file.h"
#include "reconstruct/colmap/colmap_model.h"

namespace {

template <typename Work>
double SecondsOf(const Work& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: validation_tool FIELD.npz [SPARSE]\n");
    return 2;
  }
  try {
    regrade::StoredField stored;
    const double read = SecondsOf([&] { stored = regrade::ReadFieldFile(argv[1]); });
    const double checks = SecondsOf([&] { regrade::Validate(stored.field, argv[1]); });
    double model = 0;
    if (argc > 2) model = SecondsOf([&] { regrade::ReadColmapModel(argv[2]); });
    std::printf("read %.6f\nchecks %.6f\nmodel %.6f\n", read, checks, model);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 3;
  }
}
