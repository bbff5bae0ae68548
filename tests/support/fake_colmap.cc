// A program with colmap's command line that misbehaves as its file name says: "colmap-hang"
// hangs. It poses photos on an arc around a cloud of points.
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "reconstruct/colmap/colmap_model.h"
#include "tests/support/synthetic_model.h"

namespace fs = std::filesystem;
using namespace regrade;

namespace {

std::string behaviour;
std::map<std::string, std::string> arguments;

bool Is(const char* name) { return behaviour == name; }

// The options of 3.8, and for "colmap-new" as later versions spell them.
std::vector<std::string> KnownOptions() {
  const std::string extraction = Is("new") ? "FeatureExtraction." : "SiftExtraction.";
  const std::string matching = Is("new") ? "FeatureMatching." : "SiftMatching.";
  return {"database_path",
          "image_path",
          "image_list_path",
          "output_path",
          "input_path",
          "ImageReader.single_camera",
          "ImageReader.camera_model",
          "ImageReader.camera_params",
          "ImageReader.default_focal_length_factor",
          extraction + "use_gpu",
          extraction + "num_threads",
          extraction + "max_image_size",
          "SiftExtraction.max_num_features",
          "SiftExtraction.first_octave",
          matching + "use_gpu",
          matching + "num_threads",
          "ExhaustiveMatching.block_size",
          "SequentialMatching.overlap",
          "vocab_tree_path",
          "num_visual_words",
          "branching",
          "num_iterations",
          "num_checks",
          "max_num_images",
          "VocabTreeMatching.vocab_tree_path",
          "VocabTreeMatching.num_images",
          "Mapper.num_threads",
          "Mapper.min_model_size",
          "Mapper.init_min_tri_angle",
          "Mapper.ba_refine_focal_length",
          "Mapper.ba_refine_extra_params",
          "BundleAdjustment.refine_principal_point",
          "BundleAdjustment.refine_focal_length",
          "BundleAdjustment.refine_extra_params",
          "match_list_path",
          "clear_points",
          "Mapper.filter_max_reproj_error"};
}

// COLMAP aborts without a display unless use_gpu is 0; "colmap-gpu" has a card.
void CheckGpu(const char* kind) {
  const std::string use =
      arguments[(Is("new") ? "Feature" : "Sift") + std::string(kind) + ".use_gpu"];
  if (use != (Is("gpu") ? "1" : "0")) std::abort();
}

[[noreturn]] void HangForEver() {
  std::printf("working on it\n");
  std::fflush(stdout);
  while (true) pause();
}

int Extract() {
  CheckGpu("Extraction");
  if (Is("flood"))
    for (int i = 0; i < 300000; ++i) std::printf("%0100d\n", i);
  if (Is("diskfull")) std::fprintf(stderr, "SQLite error: database or disk is full\n");
  const std::string threads =
      Is("new") ? "FeatureExtraction.num_threads" : "SiftExtraction.num_threads";
  if (Is("memory") && arguments[threads] != "1") raise(SIGKILL);
  std::ofstream database(arguments["database_path"], std::ios::app);
  std::ifstream list(arguments["image_list_path"]);
  int i = 0;
  for (std::string name; std::getline(list, name); ++i) {
    const int features = Is("plain")          ? 12
                         : Is("few") && i > 3 ? 80 + i
                         : Is("strategies")
                             ? std::stoi(arguments["SiftExtraction.max_num_features"])
                             : 1500;
    std::printf("Processed file [%d/99]\n  Name:            %s\n  Features:        %d\n", i + 1,
                name.c_str(), features);
    database << name << "\n";
  }
  database << "#features " << arguments["SiftExtraction.max_num_features"] << "\n";
  return 0;
}

void Write(ColmapModel model, const std::vector<std::string>& names,
           const std::string& folder) {
  for (size_t i = 0; i < names.size(); ++i) model.images[i].name = names[i];
  fs::create_directories(folder);
  WriteColmapModel(model, folder);
}

int Map() {
  if (Is("hang")) HangForEver();
  if (Is("nothing")) return 0;
  if (Is("crash")) std::abort();
  std::vector<std::string> names;
  std::string features;
  std::ifstream database(arguments["database_path"]);
  for (std::string line; std::getline(database, line);)
    (line.rfind("#features ", 0) == 0 ? features = line.substr(10),
     void()                           : names.push_back(line));
  std::printf("Loading matches... %d in 0.000s\n", Is("nomatches") ? 0 : Is("apart") ? 3 : 41);
  const bool too_small =
      static_cast<int>(names.size()) < std::stoi(arguments["Mapper.min_model_size"]);
  if (Is("nomodel") || Is("apart") || Is("nomatches") || Is("plain") || too_small ||
      (Is("strategies") && features != "8192")) {
    std::fprintf(stderr, "ERROR: failed to create sparse model\n");
    return 1;
  }
  testing::SyntheticModelOptions options{.images = static_cast<int>(names.size())};
  if (Is("turned")) options.arc_deg = 0.4;
  if (Is("aspect") || Is("skewed-map"))
    options.aspect = 1.3, options.lens = ColmapLens::kOpenCv;
  if (Is("planar")) options.thickness = 0.001;
  const std::string out = arguments["output_path"];
  if (arguments.count("input_path") > 0) {
    // Continues from a model of cameras alone, whose focal length may be held, and writes no
    // subfolder.
    const ColmapModel start = ReadColmapModel(arguments["input_path"]);
    const bool held = arguments["Mapper.ba_refine_focal_length"] == "0";
    if (!start.images.empty() || start.cameras.size() != 1) std::abort();
    if (Is("aspect") || (held && Is("no-lens"))) return 1;
    options.aspect = 1;
    options.lens = start.cameras[0].lens;
    if (held) options.focal = start.cameras[0].intrinsics.fx;
    Write(testing::MakeSyntheticModel(options), names, out);
    return 0;
  }
  if (Is("few")) {
    names.resize(4);
    options.images = 4;
  }
  if (Is("two")) {
    // The larger model has the second number.
    const std::vector<std::string> some(names.begin(), names.begin() + 4);
    names.erase(names.begin(), names.begin() + 4);
    options.images = 4;
    Write(testing::MakeSyntheticModel(options), some, out + "/0");
    options.images = static_cast<int>(names.size());
    Write(testing::MakeSyntheticModel(options), names, out + "/1");
    return 0;
  }
  Write(testing::MakeSyntheticModel(options), names, out + "/0");
  if (Is("half"))
    fs::resize_file(out + "/0/points3D.bin", fs::file_size(out + "/0/points3D.bin") / 2);
  // Hangs after the model is written, as COLMAP's mapper does when a time limit kills it.
  if (Is("late")) HangForEver();
  return 0;
}

int Adjust() {
  ColmapModel model = ReadColmapModel(arguments["input_path"]);
  // A principal point that diverges if it may be refined.
  if (Is("runaway") && arguments["BundleAdjustment.refine_principal_point"] == "1")
    model.cameras[0].intrinsics.cx = 500;
  const bool held = arguments["BundleAdjustment.refine_focal_length"] == "0";
  // Photos that determine neither fx / fy nor the focal length.
  const ColmapLensInfo& info = InfoOf(model.cameras[0].lens);
  const bool one_focal = info.focals == 1;
  Camera& c = model.cameras[0].intrinsics;
  if ((Is("skewed") || Is("focal") || Is("no-lens")) && !held && !one_focal)
    c.fx = 0.913 * c.fy;
  if ((Is("focal") || Is("no-lens")) && !held && one_focal) c.fx = c.fy = 20 * c.width;
  if (Is("folded") && info.coefficients > 1) c.distortion[1] = -8;
  WriteColmapModel(model, arguments["output_path"]);
  return 0;
}

// The synthetic model's points for the images of the input that features were extracted
// from, with the ids that a database might assign.
int Triangulate() {
  if (Is("hang")) HangForEver();
  if (arguments["clear_points"] != "1") return 1;  // ids would not be the database's
  const ColmapModel posed = ReadColmapModel(arguments["input_path"]);
  std::set<std::string> extracted;
  std::ifstream database(arguments["database_path"]);
  for (std::string line; std::getline(database, line);) extracted.insert(line);
  ColmapModel model =
      testing::MakeSyntheticModel({.images = static_cast<int>(posed.images.size())});
  for (size_t i = 0; i < model.images.size(); ++i) {
    if (extracted.count(posed.images[i].name) == 0) std::abort();
    model.images[i].name = posed.images[i].name;
    model.images[i].id = static_cast<uint32_t>(1000 - i);
  }
  std::reverse(model.images.begin(), model.images.end());  // by id
  for (ColmapPoint& point : model.points)
    for (ColmapTrackElement& element : point.track) element.image_id = 1001 - element.image_id;
  if (Is("sparse")) model.points.clear();
  if (Is("sparse"))
    for (ColmapImage& image : model.images) image.keypoints.clear();
  WriteColmapModel(model, arguments["output_path"]);
  if (Is("half"))
    fs::resize_file(arguments["output_path"] + "/points3D.bin",
                    fs::file_size(arguments["output_path"] + "/points3D.bin") / 2);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  behaviour = fs::path(argv[0]).filename().string().substr(std::string("colmap-").size());
  const std::string command = argc > 1 ? argv[1] : "help";
  if (Is("something-else")) {
    std::printf("hello, world\n");
    return 0;
  }
  if (command == "help") {
    std::printf("COLMAP %s -- Structure-from-Motion and Multi-View Stereo\n", Is("old") ? "2.0"
                                                                              : Is("new")
                                                                                  ? "9.9"
                                                                                  : "3.8");
    std::printf("   (Commit 0 on 2023-01-01 %s CUDA)\n",
                Is("gpu") || Is("broken-gpu") ? "with" : "without");
    return 0;
  }
  const char* platform = std::getenv("QT_QPA_PLATFORM");  // COLMAP's Qt aborts, too
  if (platform == nullptr || std::string(platform) != "offscreen") std::abort();
  // Otherwise COLMAP leaves logs in the system's temporary folder.
  if (std::getenv("GLOG_logtostderr") == nullptr) std::abort();
  const std::vector<std::string> known = KnownOptions();
  for (int i = 2; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "-h") {
      for (const std::string& option : known) std::printf("  --%s arg (=1)\n", option.c_str());
      return 0;
    }
    if (std::find(known.begin(), known.end(), name.substr(2)) == known.end() || i + 1 == argc) {
      std::fprintf(stderr, "ERROR: Failed to parse options - unrecognised option '%s'.\n",
                   argv[i]);
      return 1;
    }
    arguments[name.substr(2)] = argv[++i];
  }
  if (Is("empty")) return 0;
  if (command == "feature_extractor") return Extract();
  if (command == "mapper") return Map();
  if (command == "bundle_adjuster") return Adjust();
  if (command == "point_triangulator") return Triangulate();
  if (command == "vocab_tree_builder") {
    if (Is("no-vocabulary")) return 1;
    std::ofstream(arguments["vocab_tree_path"]) << "words\n";
    return 0;
  }
  if (command == "vocab_tree_matcher" &&
      !fs::exists(arguments["VocabTreeMatching.vocab_tree_path"]))
    return 1;
  CheckGpu("Matching");
  std::printf("Matching block [1/1, 1/1] in 0.001s\n");
  return 0;
}
