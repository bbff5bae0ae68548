#include "stylize/image/style_options.h"

#include <gtest/gtest.h>

#include "tests/support/expect_error.h"

namespace regrade {
namespace {

StyleOptions Method(const std::string& method, bool scene_wide = false) {
  return {.method = method, .scene_wide = scene_wide};
}

TEST(StyleMethod, KindAndWhatFollowsTheColon) {
  EXPECT_EQ(ParseStyleMethod(Method("mkl", true)).kind, StyleMethodKind::kMkl);
  const StyleMethod method = ParseStyleMethod(Method("command:/opt/style -x {input}"));
  EXPECT_EQ(method.kind, StyleMethodKind::kCommand);
  EXPECT_EQ(method.name, "command");
  EXPECT_EQ(method.argument, "/opt/style -x {input}");
  EXPECT_EQ(ParseStyleMethod(Method("folder:a:b")).argument, "a:b");
}

TEST(StyleMethod, UnknownMethodsAreUsageErrorsThatListTheOthers) {
  for (const char* method :
       {"", "wct2", "MKL", "mkl:", "onnx", "onnx:", "folder: ", "command:"})
    EXPECT_REGRADE_ERROR(ParseStyleMethod(Method(method)), ExitCode::kUsage,
                         "mkl, gmm, reinhard, pca-kd");
  EXPECT_REGRADE_ERROR(ParseStyleMethod(Method("folder:x", true)), ExitCode::kUsage,
                       "--scene-wide");
}

}  // namespace
}  // namespace regrade
