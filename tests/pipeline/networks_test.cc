// Networks that the program fetches: the fetch, its rules, the checkpoint's reader, the
// conversion.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "kernels/process/child_process.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/program/fetch_file.h"
#include "pipeline/program/known_networks.h"
#include "pipeline/program/tensor_bundle.h"
#include "stylize/image/onnx_stylizer.h"
#include "tests/support/canned_server.h"
#include "tests/support/data.h"
#include "tests/support/expect_error.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"
#include "tests/support/wavy_picture.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::Answer200;
using testing::CannedServer;
using testing::DataPath;
using testing::LargestDifference;
using testing::Redirect;

const std::string kCheckpoints = "weights/pca_kd_tf";
const FetchRules kLoopback{.most_bytes = 1000, .seconds = 5, .loopback = true};

TEST(FetchFile, F95_OnlyHttpsIsAsked) {
  const CannedServer server({{"/a", Answer200("x")}});
  EXPECT_REGRADE_ERROR(FetchFile(server.Address("/a")), ExitCode::kInput, "only https");
  EXPECT_REGRADE_ERROR(FetchFile("file:///etc/hostname"), ExitCode::kInput, "only https");
  EXPECT_REGRADE_ERROR(FetchFile("file:///etc/hostname", kLoopback), ExitCode::kInput,
                       "only https");
  EXPECT_REGRADE_ERROR(FetchFile("no address"), ExitCode::kInput, "no address");
  EXPECT_EQ(server.requests(), 0);
  // Nobody speaks TLS there: the connection fails, and no other protocol is tried.
  const std::string tls = "https" + server.Address("/a").substr(4);
  EXPECT_REGRADE_ERROR(FetchFile(tls, {.seconds = 5}), ExitCode::kInput, "not be fetched");
}

TEST(FetchFile, F95_RedirectsStayOnTheirHost) {
  const CannedServer other({{"/a", Answer200("elsewhere")}});
  CannedServer server({{"/a", Answer200("here")},
                       {"/same", Redirect("/a")},
                       {"/port", Redirect(other.Address("/a"))},
                       {"/name", Redirect("http://localhost/a")},
                       {"/file", Redirect("file:///etc/hostname")},
                       {"/circle", Redirect("/circle")}});
  EXPECT_EQ(FetchFile(server.Address("/same"), kLoopback), "here");
  EXPECT_REGRADE_ERROR(FetchFile(server.Address("/port"), kLoopback), ExitCode::kInput,
                       "another host");
  EXPECT_EQ(other.requests(), 0);
  for (const char* path : {"/name", "/file"})
    EXPECT_REGRADE_ERROR(FetchFile(server.Address(path), kLoopback), ExitCode::kInput,
                         "only https");
  EXPECT_REGRADE_ERROR(FetchFile(server.Address("/circle"), kLoopback), ExitCode::kInput,
                       "too often");
}

TEST(FetchFile, F95_SizeAndTimeAreBounded) {
  const std::string large(1001, 'x');
  const CannedServer server(
      {{"/said", Answer200(large)},
       {"/unsaid", "HTTP/1.1 200 OK\r\nConnection: close\r\n\r\n" + large},
       {"/most", Answer200(large.substr(1))},
       {"/short", "HTTP/1.1 200 OK\r\nContent-Length: 9\r\nConnection: close\r\n\r\nabc"},
       {"/never", ""}});
  EXPECT_EQ(FetchFile(server.Address("/most"), kLoopback).size(), 1000u);
  for (const char* path : {"/said", "/unsaid"})
    EXPECT_REGRADE_ERROR(FetchFile(server.Address(path), kLoopback), ExitCode::kInput,
                         "more than 1000 bytes");
  EXPECT_REGRADE_ERROR(FetchFile(server.Address("/short"), kLoopback), ExitCode::kInput,
                       "not be fetched");
  EXPECT_REGRADE_ERROR(FetchFile(server.Address("/none"), kLoopback), ExitCode::kInput, "404");
  FetchRules hasty = kLoopback;
  hasty.seconds = 0.3;
  EXPECT_REGRADE_ERROR(FetchFile(server.Address("/never"), hasty), ExitCode::kInput,
                       "not be fetched");
}

// The published bytes, from the data folder.
std::string Published(const std::string& name) {
  return ReadWholeFile(DataPath(kCheckpoints + "/" + name), 1 << 20);
}

// The user's data are a folder of this test.
class Networks : public ::testing::Test {
 protected:
  Networks() { ::setenv("XDG_DATA_HOME", folder_.path().c_str(), 1); }
  ~Networks() override { ::unsetenv("XDG_DATA_HOME"); }

  const testing::TemporaryFolder folder_;
  const KnownNetwork& network_ = FindNetwork("pca-kd");
  int asked_ = 0, fetched_ = 0;

  NetworkAccess From(const CannedServer& server, bool yes) {
    return {[&server, this](const std::string& address) {
              ++fetched_;
              const std::string name = address.substr(address.rfind('/'));
              return FetchFile(server.Address(name), {.loopback = true});
            },
            [yes, this](const std::string& offer) {
              ++asked_;
              EXPECT_NE(offer.find("302 kB"), std::string::npos) << offer;
              EXPECT_NE(offer.find("MIT"), std::string::npos) << offer;
              EXPECT_NE(offer.find("https://raw.githubusercontent.com/"), std::string::npos);
              return yes;
            }};
  }
};

TEST_F(Networks, F95_WithoutAYesNothingIsFetchedAndTheAddressesAreSaid) {
  for (const PublishedFile& file : network_.files) {
    EXPECT_REGRADE_ERROR(EnsureNetwork(network_, {}), ExitCode::kInput, file.address);
    EXPECT_TRUE(file.address.starts_with("https://"));
  }
  EXPECT_REGRADE_ERROR(EnsureNetwork(network_, {}), ExitCode::kInput, folder_.path());
  const CannedServer server({});
  EXPECT_REGRADE_ERROR(EnsureNetwork(network_, From(server, false)), ExitCode::kInput,
                       "was not fetched");
  EXPECT_EQ(server.requests(), 0);
  EXPECT_FALSE(fs::exists(NetworksFolder()));
  // A host that does not have them: the addresses are said, too.
  EXPECT_REGRADE_ERROR(EnsureNetwork(network_, From(server, true)), ExitCode::kInput,
                       network_.files[3].address);
  EXPECT_FALSE(HasNetwork(network_));
}

TEST_F(Networks, F95_OtherBytesAreNotUsed) {
  std::map<std::string, std::string> answers;
  for (const PublishedFile& file : network_.files)
    answers["/" + file.name] = Answer200(std::string(file.bytes, 'x'));
  const CannedServer server(answers);
  EXPECT_REGRADE_ERROR(EnsureNetwork(network_, From(server, true)), ExitCode::kInput,
                       "SHA-256");
  EXPECT_FALSE(fs::exists(NetworksFolder()));
  // The same where a person put other files there.
  for (const PublishedFile& file : network_.files)
    testing::WriteText(NetworkFolder("pca-kd") + "/" + file.name, "x");
  EXPECT_REGRADE_ERROR(EnsureNetwork(network_, {}), ExitCode::kInput, "SHA-256");
  EXPECT_FALSE(HasNetwork(network_));
}

TEST_F(Networks, FetchedOnceConvertedAndTheSamePictureAsTheSegments) {
  REGRADE_NEED_DATA(kCheckpoints);
  REGRADE_NEED_DATA("weights/pca_kd_mobilenet");
  std::map<std::string, std::string> answers;
  for (const PublishedFile& file : network_.files)
    answers["/" + file.name] = Answer200(Published(file.name));
  const CannedServer server(answers);
  const std::string folder = EnsureNetwork(network_, From(server, true));
  EXPECT_EQ(asked_, 1);
  EXPECT_EQ(fetched_, 4);
  EXPECT_EQ(EnsureNetwork(network_, From(server, true)), folder);
  EXPECT_EQ(asked_, 1);
  EXPECT_NE(testing::ReadText(folder + "/LICENSE").find("chiutaiyin"), std::string::npos);

  const Image photo = testing::WavyPicture(150, 109, {0.8, 0.9, 1.0}),
              style = testing::WavyPicture(96, 128, {1.0, 0.6, 0.35});
  const Image expected =
      MakeOnnxStylizer(DataPath("weights/pca_kd_mobilenet"), 1024, style)->Stylize(photo, 0);
  const double difference =
      LargestDifference(MakeOnnxStylizer(folder, 1024, style)->Stylize(photo, 0), expected);
  // Weights are the same bits but those of the first layer, whose stretch both fold in 32 bits.
  EXPECT_LE(difference, 2e-5);

  // Files that a person put there need no host, and no yes.
  EXPECT_TRUE(RemoveNetwork(network_));
  EXPECT_FALSE(RemoveNetwork(network_));
  fs::create_directories(folder);
  for (const PublishedFile& file : network_.files)
    WriteFileAtomically(folder + "/" + file.name, Published(file.name));
  EXPECT_EQ(EnsureNetwork(network_, {}), folder);
  EXPECT_EQ(
      LargestDifference(MakeOnnxStylizer(folder, 1024, style)->Stylize(photo, 0), expected),
      difference);
}

TEST(TensorBundle, PublishedCheckpointsAreReadWhole) {
  REGRADE_NEED_DATA(kCheckpoints);
  size_t parameters = 0;
  for (const char* name : {"sencoder", "sdecoder"}) {
    const std::string index = Published(std::string(name) + ".index"),
                      data = Published(std::string(name) + ".data-00000-of-00001");
    for (const auto& [key, tensor] : ReadTensorBundle(index, data, name))
      if (!key.starts_with("conv_aux")) parameters += tensor.values.size();
    // Any byte of a block, and any of a tensor, is under a checksum. One block, of 13 bytes, is
    // not read: it names others, of which a checkpoint has none. Neither are tensors of texts.
    int unnoticed = 0;
    for (size_t i = 0; i < index.size() - 48; i += 7) {
      std::string damaged = index;
      damaged[i] = static_cast<char>(damaged[i] ^ 64);
      try {
        ReadTensorBundle(damaged, data, name);
        ++unnoticed;
      } catch (const Error&) {
      }
    }
    EXPECT_LE(unnoticed, 2);  // of every seventh byte
    std::string damaged = data;
    damaged[1000] ^= 1;
    EXPECT_REGRADE_ERROR(ReadTensorBundle(index, damaged, name), ExitCode::kInput, "checksum");
    EXPECT_REGRADE_ERROR(ReadTensorBundle(index, data.substr(0, 5000), name), ExitCode::kInput,
                         "outside");
  }
  EXPECT_EQ(parameters, 52742u);  // of the published README's student, without PCA's bases
}

TEST(Sha256, AgreesWithItsStandard) {
  EXPECT_EQ(Sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(TensorBundle, TheChecksumAgreesWithItsStandard) {
  // RFC 3720, B.4: 32 bytes of 0, before LevelDB's rotation.
  const uint32_t crc = 0x8a9136aau;
  EXPECT_EQ(MaskedCrc32c(std::string(32, '\0')), ((crc >> 15) | (crc << 17)) + 0xa282ead8u);
}

// The built program with a user's data of its own.
class NetworkProgram : public ::testing::Test {
 protected:
  struct Outcome {
    int code = 0;
    std::string text;
  };
  Outcome Regrade(const std::vector<std::string>& arguments) const {
    ChildOptions options;
    options.argv = {REGRADE_PROGRAM};
    options.argv.insert(options.argv.end(), arguments.begin(), arguments.end());
    options.wall_limit_s = 300;
    options.environment = {{"XDG_DATA_HOME", folder_.path()}};
    Outcome outcome;
    outcome.code = RunChild(options, [&](const std::string& line) {
                     outcome.text += line + "\n";
                   }).exit_status;
    return outcome;
  }
  const testing::TemporaryFolder folder_;
};

TEST_F(NetworkProgram, F95_WithoutATerminalItExitsWith3AndTheAddresses) {
  testing::WriteText(folder_ / "photos/a.png", "x");
  const std::string style = testing::SourceDir() + "/assets/style_sunset.png";
  const Outcome outcome = Regrade({"run", folder_ / "photos", "--style", style, "--out",
                                   folder_ / "out", "--method", "pca-kd"});
  EXPECT_EQ(outcome.code, 3) << outcome.text;
  for (const PublishedFile& file : FindNetwork("pca-kd").files)
    EXPECT_SAYS(outcome, file.address);
  EXPECT_SAYS(outcome, folder_ / "regrade/networks/pca-kd");
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  EXPECT_EQ(Regrade({"run", folder_ / "photos", "--style", style, "--out", folder_ / "out",
                     "--method", "pca-kd", "--scene-wide"})
                .code,
            2);
}

TEST_F(NetworkProgram, StylesASceneWithFilesThatWerePutThere) {
  REGRADE_NEED_DATA(kCheckpoints);
  const std::string networks = folder_ / "regrade/networks/pca-kd";
  EXPECT_NE(Regrade({"networks", "list"}).text.find("not on this machine"), std::string::npos);
  fs::create_directories(networks);
  for (const PublishedFile& file : FindNetwork("pca-kd").files)
    WriteFileAtomically(networks + "/" + file.name, Published(file.name));
  ASSERT_EQ(Regrade({"synth", folder_ / "s", "--views", "6", "--size", "96x72"}).code, 0);
  std::vector<std::string> arguments{
      "run",      folder_ / "s/truth",
      "--out",    folder_ / "out",
      "--method", "pca-kd",
      "--device", "cpu",
      "--style",  testing::SourceDir() + "/assets/style_sunset.png",
      "--until",  "stylize"};
  for (const std::string& flag : testing::TinyFlags()) arguments.push_back(flag);
  const Outcome outcome = Regrade(arguments);
  EXPECT_EQ(outcome.code, 0) << outcome.text;
  EXPECT_TRUE(fs::exists(folder_ / "out/styles/style_sunset/network.npz")) << outcome.text;
  // The name stays in the record, not the folder of this machine.
  const std::string record = testing::ReadText(folder_ / "out/styles/style_sunset/run.json");
  EXPECT_NE(record.find("\"pca-kd\""), std::string::npos) << record;
  EXPECT_NE(Regrade({"networks", "list"}).text.find(networks), std::string::npos);
  EXPECT_EQ(Regrade({"networks", "remove", "pca-kd"}).code, 0);
  EXPECT_FALSE(fs::exists(networks));
  EXPECT_EQ(Regrade({"networks", "remove", "other"}).code, 2);
  EXPECT_EQ(Regrade({"networks", "fetch"}).code, 2);
}

}  // namespace
}  // namespace regrade
