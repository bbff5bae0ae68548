#include "kernels/base/hash.h"

#include <gtest/gtest.h>

#include <set>

namespace regrade {
namespace {

TEST(Hasher, IndependentOfHowTheBytesAreSplit) {
  std::string text;
  for (int i = 0; i < 100; ++i) text += static_cast<char>(i * 37);
  const uint64_t whole = HashOf(text);
  for (size_t cut = 0; cut <= text.size(); ++cut) {
    Hasher hasher;
    hasher.Add(text.substr(0, cut));
    hasher.Add(text.substr(cut));
    ASSERT_EQ(hasher.Value(), whole) << cut;
  }
}

TEST(Hasher, EveryBitAndTheLengthCount) {
  std::set<uint64_t> seen;
  std::string text(41, '\0');
  seen.insert(HashOf(text));
  for (size_t i = 0; i < text.size() * 8; ++i) {
    text[i / 8] ^= static_cast<char>(1 << i % 8);
    EXPECT_TRUE(seen.insert(HashOf(text)).second) << i;
    text[i / 8] ^= static_cast<char>(1 << i % 8);
  }
  for (size_t length = 0; length < 41; ++length)
    EXPECT_TRUE(seen.insert(HashOf(std::string(length, '\0'))).second) << length;
}

}  // namespace
}  // namespace regrade
