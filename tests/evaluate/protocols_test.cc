#include "evaluate/protocols.h"

#include <gtest/gtest.h>

#include "tests/support/expect_error.h"

namespace regrade {
namespace {

using Words = std::vector<std::string>;

TEST(Protocols, StandForTheirFlags) {
  EXPECT_EQ(ExpandProtocol({"--frames", "a", "--protocol", "liprf"}),
            (Words{"--mode=ruder2016", "--gaps=1,5", "--warp=earlier", "--frames", "a"}));
  EXPECT_EQ(
      ExpandProtocol({"--protocol=ruder2016", "--flow", "dis-fast"}),
      (Words{"--mode=ruder2016", "--gaps=1", "--error-per=channel", "--flow", "dis-fast"}));
  EXPECT_EQ(ExpandProtocol({"--protocol", "stylegaussian"}),
            (Words{"--mode=stylegaussian", "--gaps=1,7"}));
  EXPECT_EQ(ExpandProtocol({"dir", "--protocol", "geometry"}),
            (Words{"--mode=geometry", "--gaps=1,5", "--error-per=channel", "dir"}));
}

TEST(Protocols, WithoutOneTheWordsStay) {
  const Words words{"--frames", "a", "--gaps", "3"};
  EXPECT_EQ(ExpandProtocol(words), words);
  const Words after_the_flags{"--frames", "a", "--", "--protocol", "liprf"};
  EXPECT_EQ(ExpandProtocol(after_the_flags), after_the_flags);
}

TEST(Protocols, AFlagThatAgreesIsGivenOnce) {
  EXPECT_EQ(ExpandProtocol({"--protocol", "lai2018", "--gaps", "1"}),
            (Words{"--mode=lai2018", "--warp=later", "--error-per=channel", "--gaps", "1"}));
}

TEST(Protocols, AFlagThatContradictsIsRefused) {
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol", "liprf", "--gaps", "1,7"})),
                       ExitCode::kUsage, "has --gaps 1,5, not 1,7");
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--mode=ruder2016", "--protocol=lai2018"})),
                       ExitCode::kUsage, "has --mode lai2018, not ruder2016");
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol", "liprf", "--warp=later"})),
                       ExitCode::kUsage, "has --warp earlier, not later");
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol", "lai2018", "--error-per=pixel"})),
                       ExitCode::kUsage, "has --error-per channel, not pixel");
  const Words free{"--protocol", "geometry", "--warp", "earlier"};  // it leaves the direction
  EXPECT_EQ(ExpandProtocol(free), (Words{"--mode=geometry", "--gaps=1,5", "--error-per=channel",
                                         "--warp", "earlier"}));
  const Words divisor{"--protocol", "liprf", "--error-per", "pixel"};  // as the paper's text
  EXPECT_EQ(ExpandProtocol(divisor), (Words{"--mode=ruder2016", "--gaps=1,5", "--warp=earlier",
                                            "--error-per", "pixel"}));
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol", "geometry", "--flow=dis-fast"})),
                       ExitCode::kUsage, "not from flow");
}

TEST(Protocols, OptionsAreRecognized) {
  ConsistencyOptions options;
  EXPECT_EQ(ProtocolOf(options), "");  // lai2018 with a gap of 5, too
  for (const Protocol& protocol : Protocols()) {
    UseProtocol(protocol.name, &options);
    EXPECT_EQ(ProtocolOf(options), protocol.name);
  }
  UseProtocol("liprf", &options);
  EXPECT_EQ(options.gaps, (std::vector<int>{1, 5}));
  EXPECT_EQ(options.warp, "earlier");
  options.warp = "later";
  EXPECT_EQ(ProtocolOf(options), "");
  EXPECT_REGRADE_ERROR(UseProtocol("lai2081", &options), ExitCode::kUsage, "no protocol");
}

// A divisor of one's own gives 4.77 dB less: that is nobody's number under these names. LipRF
// leaves the divisor open.
TEST(Protocols, AnotherDivisorIsNotTheProtocol) {
  for (const char* name : {"lai2018", "ruder2016", "geometry"}) {
    ConsistencyOptions options;
    UseProtocol(name, &options);
    options.error_per = "pixel";
    EXPECT_EQ(ProtocolOf(options), "") << name;
    UseProtocol(name, &options);
    EXPECT_EQ(options.error_per, "channel") << name;
    EXPECT_EQ(ProtocolOf(options), name);
  }
  ConsistencyOptions open{.error_per = "pixel"};
  UseProtocol("liprf", &open);
  EXPECT_EQ(open.error_per, "pixel");
  EXPECT_EQ(ProtocolOf(open), "liprf");
}

TEST(Protocols, UnknownMissingAndRepeatedNamesAreRefused) {
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol", "lai2081"})), ExitCode::kUsage,
                       "there is no protocol 'lai2081'");
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol"})), ExitCode::kUsage,
                       "no protocol ''");
  EXPECT_REGRADE_ERROR(ExpandProtocol(Words({"--protocol=lai2018", "--protocol=liprf"})),
                       ExitCode::kUsage, "given twice");
}

}  // namespace
}  // namespace regrade
