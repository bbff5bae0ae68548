// regrade view over a whole, tiny scene: a picture becomes a style, a path becomes the film
// that `regrade render --path` makes, and nothing is written elsewhere.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <map>
#include <thread>

#include "kernels/process/child_process.h"
#include "pipeline/files/atomic_file.h"
#include "pipeline/files/json_file.h"
#include "pipeline/page/color_code.h"
#include "tests/support/hostile_requests.h"
#include "tests/support/keyframes.h"
#include "tests/support/loopback.h"
#include "tests/support/source_dir.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tiny_run.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::BodyOf;
using testing::Loopback;
using testing::PlainRequest;
using testing::ReadText;
using testing::StatusOf;
using testing::TemporaryFolder;

// The program as a person starts it, until the end of this object.
class ViewProgram {
 public:
  explicit ViewProgram(const std::string& folder) {
    thread_ = std::thread([this, folder] {
      ChildOptions options;
      options.argv = {REGRADE_PROGRAM, "view", folder, "--threads", "2"};
      options.wall_limit_s = 600;
      RunChild(
          options, [this](const std::string& line) { Take(line); }, [this] { return !stop_; });
      ended_ = true;
    });
    while (port_ == 0 && !ended_) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  ~ViewProgram() {
    stop_ = true;
    thread_.join();
  }
  int port() const { return port_; }
  std::string Ask(const std::string& method, const std::string& target,
                  const std::string& body = "", const std::string& lines = "") const {
    const Loopback client(port_);
    client.Send(PlainRequest(method, target, port_, token_, lines, body));
    return client.Receive(60);
  }
  // The job's state once it does not run any more.
  JsonValue Finished() const {
    while (true) {
      JsonValue job = ParseJson(BodyOf(Ask("GET", "/job")), "job");
      if (job.At("state").AsString() != "running") return job;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    }
  }

 private:
  void Take(const std::string& line) {
    const std::string before = "open http://127.0.0.1:";
    if (!line.starts_with(before)) return;
    const size_t hash = line.find("/#");
    token_ = line.substr(hash + 2);
    port_ = std::stoi(line.substr(before.size(), hash - before.size()));
  }

  std::string token_;
  std::atomic<int> port_ = 0;
  std::atomic<bool> stop_ = false, ended_ = false;
  std::thread thread_;
};

// Of all files that are not the style's, the film's or the program's records.
std::map<std::string, std::string> OtherFiles(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string name = entry.path().lexically_relative(folder);
    if (entry.is_regular_file() && !name.starts_with("e/styles/") &&
        !name.starts_with("e/films/") && !name.starts_with("e/.regrade/"))
      files[name] = ReadText(entry.path().string());
  }
  return files;
}

TEST(ViewCommand, ADroppedPictureBecomesAStyleAndAPathTheFilmOfRender) {
  const TemporaryFolder folder;
  testing::Said({"synth", folder / "s", "--views", "6", "--size", "96x72"});
  std::vector<std::string> reconstruct{"reconstruct", folder / "s/truth", "--out",
                                       folder / "e"};
  for (const std::string& flag : testing::TinyFlags()) reconstruct.push_back(flag);
  // So long that the style can be watched: its network comes every 50 steps.
  *std::next(std::ranges::find(reconstruct, "--style-steps")) = "250";
  testing::Said(reconstruct);
  const auto before = OtherFiles(folder / "");

  // The address comes before the scene, whose fit may still be at work, and the page with it.
  fs::rename(folder / "e/field.npz", folder / "field.npz");
  const ViewProgram view(folder / "e");
  ASSERT_NE(view.port(), 0);
  EXPECT_EQ(StatusOf(view.Ask("GET", "/")), 200);
  const std::string awaited = view.Ask("GET", "/page");
  EXPECT_EQ(StatusOf(awaited), 202);
  EXPECT_NE(ParseJson(BodyOf(awaited), "page").At("awaited").AsString().find(folder / "e"),
            std::string::npos);
  EXPECT_EQ(StatusOf(view.Ask("GET", "/job")), 503);
  fs::rename(folder / "field.npz", folder / "e/field.npz");
  while (StatusOf(view.Ask("GET", "/page")) == 202)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  const std::string opening = view.Ask("GET", "/");
  EXPECT_EQ(StatusOf(opening), 200);
  EXPECT_EQ(opening.find("id=\"scene\""), std::string::npos);
  const std::string page = view.Ask("GET", "/page");
  EXPECT_NE(page.find("id=\"scene\""), std::string::npos);
  EXPECT_NE(page.find("connect-src 'self'"), std::string::npos);

  EXPECT_EQ(StatusOf(view.Ask("POST", "/style", "no picture")), 415);
  const std::string refused = view.Ask("POST", "/film", "{\"format\": 7}");
  EXPECT_EQ(StatusOf(refused), 422);
  EXPECT_NE(refused.find("save the path again"), std::string::npos) << refused;
  EXPECT_EQ(StatusOf(view.Ask("GET", "/style")), 404);
  EXPECT_EQ(StatusOf(view.Ask("GET", "/style/codes")), 404);
  EXPECT_EQ(StatusOf(view.Ask("GET", "/learning/codes")), 404);
  EXPECT_EQ(StatusOf(view.Ask("GET", "/film")), 404);

  const std::string picture = ReadText(testing::SourceDir() + "/assets/style_sunset.png");
  const std::string hostile_name = "Regrade-Name: ../../.. /an evil name.png\r\n";
  EXPECT_EQ(StatusOf(view.Ask("POST", "/style", picture, hostile_name)), 202);
  EXPECT_EQ(StatusOf(view.Ask("POST", "/style", picture)), 409);
  int so_far = 0;
  while (ParseJson(BodyOf(view.Ask("GET", "/job")), "job").At("state") == JsonValue("running"))
    so_far += StatusOf(view.Ask("GET", "/learning")) == 200;
  EXPECT_GE(so_far, 1);
  EXPECT_EQ(StatusOf(view.Ask("GET", "/learning")), 204);
  JsonValue job = view.Finished();
  ASSERT_EQ(job.At("state").AsString(), "done") << DumpJson(job);
  EXPECT_TRUE(fs::exists(folder / "e/styles/an_evil_name/network.npz"));
  EXPECT_FALSE(fs::exists(folder / "e/styles/an_evil_name/frames"));  // of later stages
  const JsonValue style = ParseJson(BodyOf(view.Ask("GET", "/style")), "style");
  EXPECT_GT(style.At("weights").AsString().size(), 1000u);
  EXPECT_EQ(style.At("name").AsString(), "an_evil_name");
  const std::string codes = BodyOf(view.Ask("GET", "/style/codes"));
  constexpr size_t kVoxel = 4 * kCodeWords;  // bytes
  EXPECT_GT(codes.size(), kVoxel * 100);
  EXPECT_EQ(codes.size() % kVoxel, 0u);

  JsonValue path = testing::SomeKeyframes();
  path["styles"] = JsonValue::Array{style.At("id"), "unknown"};
  JsonValue::Array keyframes = path.At("keyframes").AsArray();
  keyframes.resize(2);
  keyframes[1]["time"] = 0.125;
  path["keyframes"] = keyframes;
  EXPECT_EQ(StatusOf(view.Ask("POST", "/film", DumpJson(path))), 202);
  job = view.Finished();
  ASSERT_EQ(job.At("state").AsString(), "done") << DumpJson(job);
  const std::string film = ReadText(folder / "e/films/film.mp4");
  EXPECT_GT(film.size(), 1000u);
  EXPECT_EQ(BodyOf(view.Ask("GET", "/film")), film);
  WriteJsonFile(folder / "e/films/again.json", path);
  ASSERT_EQ(
      testing::Regrade({"render", folder / "e", "--path", folder / "e/films/again.json"}).code,
      0);
  EXPECT_EQ(ReadText(folder / "e/films/again.mp4"), film);

  // A damaged picture ends its job, with a reason, and nothing else.
  EXPECT_EQ(StatusOf(view.Ask("POST", "/style", picture.substr(0, 200))), 202);
  job = view.Finished();
  EXPECT_EQ(job.At("state").AsString(), "failed");
  EXPECT_FALSE(job.At("error").AsString().empty());
  const std::string other = ReadText(testing::SourceDir() + "/assets/style_night.png");
  EXPECT_EQ(StatusOf(view.Ask("POST", "/style", other)), 202);
  EXPECT_EQ(StatusOf(view.Ask("DELETE", "/job")), 200);
  EXPECT_EQ(view.Finished().At("state").AsString(), "cancelled");

  EXPECT_EQ(OtherFiles(folder / ""), before);
}

TEST(ViewCommand, EndsWhereNoSceneWillCome) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "no run");
  EXPECT_EQ(testing::ExitCodeOf({"view", folder / "no run"}), 3);
  fs::create_directories(folder / "begun/.regrade");
  EXPECT_EQ(testing::ExitCodeOf({"view", folder / "begun", "night"}),
            3);  // a style before its scene
  WriteFileAtomically(folder / "begun/field.npz", "damaged");
  EXPECT_EQ(testing::ExitCodeOf({"view", folder / "begun"}), 3);
}

}  // namespace
}  // namespace regrade
