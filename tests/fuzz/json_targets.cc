// Fuzz target: JSON.
#include "pipeline/files/json_file.h"
#include "tests/fuzz/fuzz_support.h"
#include "tests/fuzz/mutate.h"

namespace regrade::testing {
namespace {

std::vector<std::string> JsonSeeds() {
  return {R"({"a": [1, -2.5, 1e300, true, null, "x\u00e9\n"], "b": {"c": {}}, "d": [[[]]]})",
          "18446744073709551615", "\xef\xbb\xbf[0.1]"};
}

bool ReadJson(std::string_view bytes) {
  return Accepts([bytes] {
    const JsonValue value = ParseJson(bytes, "fuzz.json");
    FuzzRequire(ParseJson(DumpJson(value), "again") == value, "a round trip keeps the value");
  });
}

}  // namespace

std::vector<FuzzTarget> JsonTargets() {
  return {{"json", JsonSeeds, ReadJson, MutateJson, 50000}};
}

}  // namespace regrade::testing
