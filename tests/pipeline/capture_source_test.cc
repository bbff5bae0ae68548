// Which files of a folder are its photos, and which poses belong to them: layouts of other
// programs, names written on other systems, and camera files that name what is not theirs.
#include "pipeline/capture/capture_source.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/capture/capture_store.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/capture/listed_pictures.h"
#include "pipeline/capture/transforms_json.h"
#include "pipeline/files/text.h"
#include "reconstruct/colmap/colmap_text.h"
#include "tests/support/expect_error.h"
#include "tests/support/synthetic_model.h"
#include "tests/support/temporary_folder.h"

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::TemporaryFolder;
using testing::WriteText;

class CaptureFolder : public ::testing::Test {
 protected:
  CaptureFolder() { fs::create_directories(root_); }

  void Put(const std::vector<std::string>& names) const {
    for (const std::string& name : names) WriteText(root_ + "/" + name, "x");
  }
  // With a frame for each name, and `more` members at the top.
  std::string WriteTransforms(const std::vector<std::string>& names,
                              const std::string& more = "", const std::string& in_frame = "") {
    std::string frames;
    for (const std::string& name : names)
      frames += std::string(frames.empty() ? "" : ",\n") +
                "{\"file_path\":" + DumpJson(JsonValue(name), -1) + in_frame +
                ",\"transform_matrix\":[[1,0,0,0],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}";
    WriteText(root_ + "/transforms.json",
              "{\"fl_x\":100,\"w\":64,\"h\":48" + more + ",\n\"frames\":[" + frames + "]}");
    return root_ + "/transforms.json";
  }
  void WriteModel(const std::string& folder, int images) const {
    fs::create_directories(root_ + "/" + folder);
    WriteColmapModel(testing::MakeSyntheticModel({.images = images, .points = 4}),
                     root_ + "/" + folder);
  }
  std::string Inside(const std::string& path) const {
    return fs::path(path).lexically_relative(fs::canonical(root_)).string();
  }
  static std::set<std::string> Listed(const CaptureSource& source) {
    std::set<std::string> names;
    for (const InputFile& input : InputsOf(source).files) names.insert(input.file.name);
    return names;
  }
  CaptureSource Detect() const { return DetectCapture(root_); }

  const TemporaryFolder folder_;
  const std::string root_ = folder_ / "home/capture";
};

using Names = std::set<std::string>;

TEST_F(CaptureFolder, OnlyTheListedPicturesAreLookedAt) {
  Put({"images/0.png", "images/1.png", "images/other.png", "secret.txt"});
  WriteTransforms({"images/0.png", "images/1.png"});
  const CaptureSource source = Detect();
  EXPECT_EQ(source.kind, CaptureKind::kTransforms);
  EXPECT_EQ(Listed(source), (Names{"0.png", "1.png"}));
  EXPECT_TRUE(source.notes.empty());
}

TEST_F(CaptureFolder, PicturesFarFromTheCameraFileAreRefused) {
  Put({"images/0.png"});
  WriteText(folder_ / "home/private.png", "x");
  WriteText(folder_ / "Pictures/private.png", "x");
  for (const std::string& name :
       {std::string("/etc/passwd"), std::string("../../Pictures/private.png"),
        std::string("images/../../../Pictures/private.png"), std::string("../private.png"),
        std::string("..\\..\\Pictures\\private.png"), folder_ / "Pictures/private.png",
        std::string("/nowhere/0.png")}) {
    WriteTransforms({"images/0.png", name});
    EXPECT_REGRADE_ERROR(Detect(), ExitCode::kInput,
                         fs::canonical(root_).string() + "/transforms.json:3:");
    // So are masks, whether their photo is there or not.
    WriteTransforms({"images/0.png"}, "", ",\"mask_path\":" + DumpJson(JsonValue(name), -1));
    EXPECT_REGRADE_ERROR(Detect(), ExitCode::kInput, "neither in the folder");
  }
}

TEST_F(CaptureFolder, PicturesBesideTheCaptureAreNamed) {
  Put({"images/0.png"});
  WriteText(folder_ / "home/photos/1.png", "x");
  WriteText(folder_ / "home/photos/secret.png", "x");
  WriteTransforms({"images/0.png", "../photos/1.png"});
  const CaptureSource source = Detect();
  EXPECT_EQ(Listed(source), (Names{"capture/images/0.png", "photos/1.png"}));
  ASSERT_EQ(source.notes.size(), 1u);
  EXPECT_NE(source.notes[0].find("../photos"), std::string::npos);
  // An absolute name is as good.
  WriteTransforms({fs::canonical(root_).string() + "/images/0.png"});
  EXPECT_EQ(Listed(Detect()), (Names{"0.png"}));
}

TEST_F(CaptureFolder, ListedLinksAreFollowedToRegularFilesOnly) {
  WriteText(folder_ / "disk/0.png", "x");
  fs::create_directories(root_ + "/images");
  fs::create_symlink(folder_ / "disk/0.png", root_ + "/images/0.png");
  ASSERT_EQ(::mkfifo((root_ + "/images/1.png").c_str(), 0600), 0);
  fs::create_symlink("1.png", root_ + "/images/2.png");
  WriteTransforms({"images/0.png", "images/1.png", "images/2.png"});
  const InputFiles inputs = InputsOf(Detect());
  ASSERT_EQ(inputs.files.size(), 1u);
  EXPECT_EQ(inputs.files[0].file.path, fs::canonical(folder_ / "disk/0.png").string());
  // A pipe that is put there later is not opened.
  fs::remove(folder_ / "disk/0.png");
  ASSERT_EQ(::mkfifo((folder_ / "disk/0.png").c_str(), 0600), 0);
  const InputFiles later = ListInputs(root_ + "/images", false, {"0.png"});
  EXPECT_EQ(later.files.at(0).file.problem, "a named pipe, not a file");
}

TEST_F(CaptureFolder, APictureIsListedOnce) {
  Put({"images/3.jpg"});
  for (const char* again :
       {"./images/3.jpg", "images/3", "images\\3.jpg", "images/x/../3.jpg"}) {
    WriteTransforms({"images/3.jpg", again});
    EXPECT_REGRADE_ERROR(Detect(), ExitCode::kInput, "/transforms.json:3:", "listed twice");
  }
}

TEST_F(CaptureFolder, NamesOfOtherSystems) {
  Put({"images/0.JPG", "images/1.tif", "images/2.jpeg", "Images2/3.png", "images/4.PNG",
       "images/4.jpg"});
  WriteTransforms(
      {"images/0", "images\\1.png", "IMAGES/2.jpg", "images2/3.png", "images/4.png"});
  const CaptureSource source = Detect();
  EXPECT_EQ(source.only, (Names{"images/0.JPG", "images/1.tif", "images/2.jpeg",
                                "Images2/3.png", "images/4.PNG"}));
  ASSERT_EQ(source.notes.size(), 1u);
  EXPECT_TRUE(source.notes[0].starts_with("4 pictures")) << source.notes[0];
  // Several of another ending: none is meant.
  WriteTransforms({"images/0", "images/4.webp"});
  EXPECT_EQ(ReadTransformsJson(root_ + "/transforms.json").missing,
            (std::vector<std::string>{"images/4.webp"}));
}

TEST_F(CaptureFolder, TheNearestNameIsTold) {
  Put({"images/frame_00001.jpg", "images/frame_00012.jpg", "x/y.jpg"});
  WriteTransforms({"images/frame00012.jpg"});
  EXPECT_REGRADE_ERROR(Detect(), ExitCode::kInput,
                       "nearest to it is \"images/frame_00012.jpg\"");
  WriteTransforms({"pictures/frame_00001.png"});
  EXPECT_REGRADE_ERROR(Detect(), ExitCode::kInput,
                       "nearest to it is \"images/frame_00001.jpg\"");
}

TEST_F(CaptureFolder, MasksThatThePosesName) {
  Put({"images/0.png", "masks/0.PNG"});
  WriteTransforms({"images/0.png"}, "", R"(,"mask_path":"./masks/0.png")");
  const CaptureSource source = Detect();
  ASSERT_EQ(source.masks.size(), 1u);
  EXPECT_EQ(Inside(source.masks.at("0.png")), "masks/0.PNG");
  fs::remove_all(root_ + "/masks");
  EXPECT_TRUE(Detect().masks.empty());
  ASSERT_EQ(Detect().notes.size(), 1u);
  EXPECT_TRUE(Detect().notes[0].starts_with("the masks of 1 photos are missing"));
}

TEST_F(CaptureFolder, PhotosForTestsByName) {
  const std::vector<std::string> names{"images/0.png", "images/1.png", "images/2.png",
                                       "images/3.png"};
  Put(names);
  const auto detect = [&](const std::string& lists) {
    WriteTransforms(names, lists);
    return Detect();
  };
  CaptureSource source =
      detect(R"(,"train_filenames":["images/0.png"],"test_filenames":["./images/2.png"],)"
             R"("val_filenames":["images/3.png"])");
  EXPECT_EQ(source.test, (Names{"2.png"}));
  EXPECT_EQ(source.only, (Names{"0.png", "2.png"}));
  EXPECT_EQ(source.notes.size(), 1u) << "two are left out";
  // Without photos for tests those for validation are measured, but for those that are fitted.
  source = detect(R"(,"train_filenames":["images/0.png","images/1.png","images/2.png"],)"
                  R"("test_filenames":[],"val_filenames":["images/2.png","images/3.png"])");
  EXPECT_EQ(source.test, (Names{"3.png"}));
  EXPECT_EQ(source.only.size(), 4u);
  source = detect(R"(,"test_filenames":["images/1.png"])");
  EXPECT_EQ(source.test, (Names{"1.png"}));
  EXPECT_EQ(source.only.size(), 4u);
  EXPECT_TRUE(detect("").test.empty());
  for (const char* wrong :
       {R"(,"train_filenames":["images/1.png"],"test_filenames":["images/1.png"])",
        R"(,"test_filenames":["images/9.png"])", R"(,"test_filenames":[7])",
        R"(,"val_filenames":"images/1.png")"})
    EXPECT_REGRADE_ERROR(detect(wrong), ExitCode::kInput, "transforms.json:1:");
}

TEST_F(CaptureFolder, TheLargestColmapModelIsTaken) {
  Put({"images/00000.png"});
  WriteModel("sparse/0", 2);
  EXPECT_TRUE(Detect().notes.empty());
  WriteModel("sparse/1", 5);
  WriteModel("sparse/2", 3);
  CaptureSource source = Detect();
  EXPECT_EQ(source.kind, CaptureKind::kColmap);
  EXPECT_EQ(Inside(source.poses), "sparse/1");
  ASSERT_EQ(source.notes.size(), 1u);
  EXPECT_NE(source.notes[0].find("of 3 COLMAP models sparse/1"), std::string::npos);
  // Text counts as well.
  fs::create_directories(root_ + "/sparse/10");
  WriteColmapText(testing::MakeSyntheticModel({.images = 7, .points = 4}),
                  root_ + "/sparse/10");
  EXPECT_EQ(Inside(Detect().poses), "sparse/10");
  // A count that the file is too short for counts for nothing.
  WriteText(root_ + "/sparse/2/images.bin", std::string("\xff\xff\0\0\0\0\0\0", 8));
  EXPECT_EQ(Inside(Detect().poses), "sparse/10");
}

TEST_F(CaptureFolder, ModelsInTheFoldersOfOtherPrograms) {
  Put({"images/00000.png", "images_2/00000.png"});
  WriteModel("colmap/sparse/0", 3);  // nerfstudio
  CaptureSource source = Detect();
  EXPECT_EQ(Inside(source.poses), "colmap/sparse/0");
  EXPECT_EQ(Inside(source.photos), "images");
  EXPECT_EQ(Listed(source), (Names{"00000.png"}));

  fs::rename(root_ + "/colmap", root_ + "/distorted");  // 3D Gaussian Splatting
  Put({"input/00000.png", "input/00001.png"});
  source = Detect();
  EXPECT_EQ(Inside(source.poses), "distorted/sparse/0");
  EXPECT_EQ(Inside(source.photos), "input");
  WriteModel("sparse/0", 2);  // of the undistorted pictures
  EXPECT_EQ(Inside(Detect().poses), "sparse/0");
}

TEST_F(CaptureFolder, WhatLiesBesideThePicturesIsLeft) {
  Put({"images/0.png", "images_2/0.png", "depth/0.png", "masks/0.png", "more/1.png"});
  WriteModel("work/model", 2);
  const CaptureSource source = Detect();
  EXPECT_EQ(source.kind, CaptureKind::kPhotos);
  const Names listed = Listed(source);
  EXPECT_TRUE(listed.contains("images/0.png"));
  EXPECT_TRUE(listed.contains("more/1.png"));
  for (const char* left : {"images_2/0.png", "depth/0.png", "masks/0.png"})
    EXPECT_FALSE(listed.contains(left)) << left;
  ASSERT_EQ(source.notes.size(), 2u);
  EXPECT_NE(source.notes[0].find("depth, images_2, masks"), std::string::npos);
  EXPECT_NE(source.notes[1].find("work/model"), std::string::npos);
  // Without images/ they are folders like any other.
  fs::remove_all(root_ + "/images");
  EXPECT_TRUE(Listed(Detect()).contains("images_2/0.png"));
}

TEST_F(CaptureFolder, PolycamsRawExport) {
  Put({"keyframes/images/1.jpg", "keyframes/corrected_images/1.jpg", "keyframes/depth/1.png",
       "keyframes/confidence/1.png", "thumbnail.jpg"});
  CaptureSource source = Detect();
  EXPECT_EQ(source.kind, CaptureKind::kPhotos);
  EXPECT_EQ(Listed(source), (Names{"keyframes/images/1.jpg", "thumbnail.jpg"}));
  EXPECT_EQ(source.notes.size(), 1u);
  Put({"keyframes/corrected_cameras/1.json"});
  source = Detect();
  EXPECT_EQ(source.kind, CaptureKind::kPolycam);
  EXPECT_EQ(Inside(source.photos), "keyframes/corrected_images");
  EXPECT_EQ(Inside(source.poses), "keyframes/corrected_cameras");
  EXPECT_TRUE(LacksPoints(source.kind));
  EXPECT_EQ(source.notes.size(), 1u);
}

TEST_F(CaptureFolder, FoldersOfMasksAndOfResultsAreNoPhotos) {
  Put({"0.jpg", "masks/0.png", "day/1.jpg", "out/run.json", "out/poses/photos/00000.png",
       "day/old/styles/a/frames/00000.png", "masks2/0.png"});
  fs::create_directories(root_ + "/out/.regrade");
  fs::create_directories(root_ + "/day/old/.regrade");
  const CaptureSource source = DetectCapture(root_, {root_ + "/masks/", ""});
  const InputFiles inputs = InputsOf(source);
  EXPECT_EQ(Listed(source), (Names{"0.jpg", "day/1.jpg", "masks2/0.png"}));
  EXPECT_EQ(inputs.runs, (std::vector<std::string>{"day/old", "out"}));
  // Of a folder of masks that holds the photos everything is left.
  EXPECT_EQ(Listed(DetectCapture(root_, {root_})).size(), 4u);
}

class ColmapNames : public CaptureFolder {
 protected:
  // Poses of a model with these names for photos with those.
  Capture Import(const std::vector<std::string>& names, const std::vector<std::string>& files,
                 std::vector<std::string>* notes) const {
    ColmapModel model =
        testing::MakeSyntheticModel({.images = static_cast<int>(names.size()), .points = 4});
    for (size_t i = 0; i < names.size(); ++i) model.images[i].name = names[i];
    for (const char* folder : {"/sparse", "/staged"}) fs::create_directories(root_ + folder);
    WriteColmapModel(model, root_ + "/sparse");
    std::vector<StagedPhoto> photos;
    std::vector<PhotoStatus> statuses;
    for (size_t i = 0; i < files.size(); ++i) {
      StagedPhoto photo;
      photo.file = files[i];
      photo.name = testing::StagedName(static_cast<int>(i));
      photo.width = 640, photo.height = 480;
      photos.push_back(photo);
      statuses.push_back({files[i], PhotoState::kUsed, ""});
    }
    return ImportPoses({CaptureKind::kColmap, root_ + "/images", root_ + "/sparse"}, &photos,
                       statuses, root_ + "/staged", notes);
  }
};

TEST_F(ColmapNames, OfOtherSystemsAreFound) {
  std::vector<std::string> notes;
  const Capture capture =
      Import({"cam0\\1.jpg", "cam0/0.png", "gone.jpg"}, {"cam0/0.JPG", "cam0/1.jpg"}, &notes);
  ASSERT_EQ(capture.views.size(), 2u);
  EXPECT_EQ(capture.views[0].file, "cam0/0.JPG");
  // The middle camera of three looks straight ahead.
  EXPECT_NEAR(capture.views[0].camera.Center().x, 0, 1e-9);
  EXPECT_GT(std::abs(capture.views[1].camera.Center().x), 1);
  EXPECT_EQ(capture.statuses.back().file, "gone.jpg");
  ASSERT_EQ(notes.size(), 2u);
  EXPECT_TRUE(notes[0].starts_with("2 pictures have other names")) << notes[0];
}

TEST_F(ColmapNames, AnExactNameComesFirst) {
  std::vector<std::string> notes;
  // The first camera is on the right.
  const auto x_of = [&](const std::vector<std::string>& names) {
    return Import(names, {"0.jpg"}, &notes).views.at(0).camera.Center().x;
  };
  EXPECT_GT(x_of({"0.jpg", "0.png"}), 1);
  EXPECT_LT(x_of({"0.png", "0.jpg"}), -1);
}

TEST_F(ColmapNames, TheUsersNamesAreTold) {
  std::vector<std::string> notes;
  const Error error = testing::ErrorFrom([&] {
    Import({"shot_0001.png"}, {"shot0001.jpg", "other.jpg", "more.jpg"}, &notes);
  });
  EXPECT_EQ(error.code(), ExitCode::kInput);
  EXPECT_EQ(error.where(), root_ + "/sparse");
  const std::string what = error.what();
  EXPECT_NE(what.find("\"shot_0001.png\""), std::string::npos) << what;
  EXPECT_NE(what.find("\"shot0001.jpg\""), std::string::npos) << what;
  EXPECT_EQ(what.find("absent/"), std::string::npos) << what;
}

TEST(ListedPictures, FarNamesAreRefusedBeforeTheDiskIsAsked) {
  const TemporaryFolder folder;
  WriteText(folder / "c/images/a.png", "x");
  ListedPictures pictures(folder / "c");
  EXPECT_EQ(pictures.Find("images/a.png", "f:1"), "images/a.png");
  EXPECT_EQ(pictures.Find("images/b.png", "f:1"), "");
  EXPECT_EQ(pictures.Find("../c/images/a.png", "f:1"), "images/a.png");
  for (const char* name :
       {"..", "../a.png", "../../a.png", "/", "../../../../../../etc/passwd"})
    EXPECT_REGRADE_ERROR(pictures.Find(name, "f:1"), ExitCode::kInput, "f:1");
  // A folder that was reached through a link is the same folder.
  fs::create_directory_symlink(folder / "c", folder / "link");
  EXPECT_EQ(pictures.Find(folder / "link/images/a.png", "f:1"), "images/a.png");
}

}  // namespace
}  // namespace regrade
