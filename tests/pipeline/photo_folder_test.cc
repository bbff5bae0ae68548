#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

#include "kernels/base/error.h"
#include "kernels/base/natural_order.h"
#include "pipeline/capture/ingest_photos.h"
#include "pipeline/files/atomic_file.h"
#include "tests/pipeline/picture_corpus.h"
#include "tests/support/expect_error.h"

// Every read of this program comes by here: while this is set, drives are gone.
static std::atomic<bool> drive_is_gone = false;

extern "C" ssize_t read(int fd, void* buffer, size_t size) {
  if (!drive_is_gone) return ::syscall(SYS_read, fd, buffer, size);
  errno = EIO;
  return -1;
}

namespace regrade {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::ExifBlock;
using testing::Photo;
using testing::TemporaryFolder;
using testing::WithSegment;
using testing::WriteText;

class PhotoFolder : public ::testing::Test {
 protected:
  PhotoFolder() { fs::create_directory(folder_); }

  void PutPhoto(const std::string& name, uint64_t seed) {
    WriteText(folder_ + "/" + name, EncodeJpeg(Photo(96, 64, seed), 90));
  }
  void PutPhotos(int count) {
    for (int i = 0; i < count; ++i)
      PutPhoto(std::string("p").append(std::to_string(i)) + ".jpg", i);
  }
  IngestResult Ingest(const IngestOptions& options = {}) {
    return IngestPhotos(folder_, staging_, options, {});
  }
  Error Failure() {
    return testing::ErrorFrom([&] { Ingest(); });
  }
  static std::vector<std::string> Files(const IngestResult& result) {
    std::vector<std::string> files;
    for (const StagedPhoto& photo : result.photos) files.push_back(photo.file);
    return files;
  }

  TemporaryFolder scratch_;
  std::string folder_ = scratch_ / "photos", staging_ = scratch_ / "out/poses/photos";
};

TEST(NaturalOrder, CountsLikeAPerson) {
  const std::vector<std::string> ordered = {"a/10",
                                            "a b",
                                            "a1",
                                            "A01",
                                            "a1b",
                                            "A2",
                                            "a10",
                                            "a010b",
                                            "b",
                                            "img_9.jpg",
                                            "img_10.jpg",
                                            "img_99999999999999999999998.jpg",
                                            "img_99999999999999999999999.jpg",
                                            "\xff\xfe"};
  for (size_t i = 0; i < ordered.size(); ++i)
    for (size_t j = 0; j < ordered.size(); ++j) {
      if (ordered[i] == "a1" && ordered[j] == "A01") continue;  // by bytes, below
      if (ordered[i] == "A01" && ordered[j] == "a1") continue;
      EXPECT_EQ(NaturalLess(ordered[i], ordered[j]), i < j) << ordered[i] << " " << ordered[j];
    }
  EXPECT_TRUE(NaturalLess("A01", "a1"));
  EXPECT_FALSE(NaturalLess("a1", "A01"));
}

TEST(NaturalOrder, IsATotalOrder) {
  std::vector<std::string> names;
  for (int i = 0; i < 60; ++i) {
    std::string name;
    for (int k = 0; k < 4; ++k) name += "0019aB/_"[RandomIndex(7, i, k, 8)];
    names.push_back(name);
  }
  for (const auto& a : names)
    for (const auto& b : names) {
      EXPECT_EQ(NaturalLess(a, b) + NaturalLess(b, a), a == b ? 0 : 1) << a << " " << b;
      for (const auto& c : names)
        if (NaturalLess(a, b) && NaturalLess(b, c)) {
          EXPECT_TRUE(NaturalLess(a, c)) << a << " " << b << " " << c;
        }
    }
}

TEST_F(PhotoFolder, StagesInNaturalOrder) {
  for (const int i : {10, 2, 1}) PutPhoto("view" + std::to_string(i) + ".jpg", i);
  PutPhoto("sub/view3.JPEG", 30);
  const IngestResult result = Ingest();
  EXPECT_EQ(Files(result), (std::vector<std::string>{"sub/view3.JPEG", "view1.jpg", "view2.jpg",
                                                     "view10.jpg"}));
  for (size_t i = 0; i < result.photos.size(); ++i) {
    const StagedPhoto& photo = result.photos[i];
    EXPECT_EQ(photo.name, "0000" + std::to_string(i) + ".png");
    EXPECT_EQ(photo.path, staging_ + "/" + photo.name);
    EXPECT_EQ(ReadImage(photo.path).pixels,
              DecodePhoto(folder_ + "/" + photo.file).image.pixels);
    EXPECT_EQ(photo.width, 96);
    EXPECT_EQ(photo.height, 64);
  }
  EXPECT_TRUE(result.notices.empty());
}

TEST_F(PhotoFolder, BadFilesAreNamedAndLeftOut) {
  PutPhotos(3);
  const std::string jpeg = EncodeJpeg(Photo(96, 64, 50), 90);
  WriteText(folder_ + "/cut.jpg", jpeg.substr(0, jpeg.size() / 2));
  WriteText(folder_ + "/empty.jpg", "");
  WriteText(folder_ + "/notes.txt", "shot on a rainy day");
  WriteText(folder_ + "/tiny.png", EncodePng8(Photo(16, 16, 1)));
  const IngestResult result = Ingest();
  EXPECT_EQ(result.photos.size(), 3u);
  EXPECT_EQ(result.statuses.size(), 7u);
  EXPECT_TRUE(Contains(testing::WhyNot(result, "cut.jpg"), "damaged JPEG"));
  EXPECT_EQ(testing::WhyNot(result, "empty.jpg"), "empty file");
  EXPECT_EQ(testing::WhyNot(result, "notes.txt"), "not an image");
  EXPECT_TRUE(Contains(testing::WhyNot(result, "tiny.png"), "less than 64"));
  EXPECT_EQ(result.notices.size(), 3u) << "what never was a photo is left out quietly";
  IngestOptions options{.accept_damaged = true};
  EXPECT_EQ(Ingest(options).photos.size(), 4u);
}

TEST_F(PhotoFolder, F8_PipesSocketsAndFoldersNeverBlock) {
  PutPhotos(3);
  ASSERT_EQ(::mkfifo((folder_ + "/pipe.jpg").c_str(), 0600), 0);
  fs::create_directory(folder_ + "/folder.jpg");
  const int fd = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address = {AF_UNIX, {}};
  const std::string name = folder_ + "/s.jpg";
  name.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  const IngestResult result = Ingest();
  ::close(fd);
  EXPECT_EQ(result.photos.size(), 3u);
  EXPECT_TRUE(Contains(testing::WhyNot(result, "pipe.jpg"), "a named pipe"));
  EXPECT_TRUE(Contains(testing::WhyNot(result, "s.jpg"), "a socket"));
}

TEST_F(PhotoFolder, F9_LinksNeitherLoopNorLeadOut) {
  PutPhotos(3);
  fs::create_directory(folder_ + "/sub");
  fs::create_directory_symlink("..", folder_ + "/sub/up");
  fs::create_symlink("self.jpg", folder_ + "/self.jpg");
  WriteText(scratch_ / "photos2/secret.jpg", EncodeJpeg(Photo(96, 64, 99), 90));
  fs::create_symlink(scratch_ / "photos2/secret.jpg", folder_ + "/secret.jpg");
  fs::create_directory_symlink(scratch_ / "photos2", folder_ + "/elsewhere");
  fs::create_symlink("p1.jpg", folder_ + "/q.jpg");
  const IngestResult result = Ingest();
  EXPECT_EQ(Files(result), (std::vector<std::string>{"p0.jpg", "p1.jpg", "p2.jpg"}));
  EXPECT_TRUE(Contains(testing::WhyNot(result, "self.jpg"), "broken link"));
  EXPECT_TRUE(Contains(testing::WhyNot(result, "secret.jpg"), "leads out"));
  EXPECT_TRUE(Contains(testing::WhyNot(result, "elsewhere"), "leads out"));
  EXPECT_TRUE(Contains(testing::WhyNot(result, "sub/up"), "link to a folder"));
  EXPECT_EQ(testing::WhyNot(result, "q.jpg"), "the same picture as p1.jpg");
}

TEST_F(PhotoFolder, F9_ALinkToTheFolderItselfIsFine) {
  PutPhotos(3);
  fs::create_directory_symlink("photos", scratch_ / "link");
  EXPECT_EQ(IngestPhotos(scratch_ / "link", staging_, {}, {}).photos.size(), 3u);
}

TEST_F(PhotoFolder, F10_BrokenLinksAndUnreadableFiles) {
  PutPhotos(4);
  fs::create_symlink("gone.jpg", folder_ + "/broken.jpg");
  ASSERT_EQ(::chmod((folder_ + "/p3.jpg").c_str(), 0), 0);
  const IngestResult result = Ingest();
  EXPECT_TRUE(Contains(testing::WhyNot(result, "broken.jpg"), "No such file"));
  if (::geteuid() != 0) {  // root reads everything
    EXPECT_TRUE(Contains(testing::WhyNot(result, "p3.jpg"), "Permission denied"));
  }
}

TEST_F(PhotoFolder, F11_OddNamesWork) {
  const std::vector<std::string> names = {
      "-rf.jpg",      "$(touch x).jpg",        "a b.jpg",  "line\nbreak.jpg",
      "quo\"te'.jpg", "\xff\xfe not utf8.jpg", "%s%n.jpg", std::string(251, 'x') + ".jpg"};
  for (size_t i = 0; i < names.size(); ++i) PutPhoto(names[i], i);
  const IngestResult result = Ingest();
  EXPECT_EQ(result.photos.size(), names.size());
  for (const std::string& name : names) EXPECT_EQ(testing::WhyNot(result, name), "used");
}

TEST_F(PhotoFolder, F12_NamesThatDifferInCaseAreKeptApart) {
  PutPhoto("a.jpg", 1);
  PutPhoto("A.jpg", 2);
  PutPhoto("a.JPG", 3);
  EXPECT_EQ(Ingest().photos.size(), 3u);
}

TEST_F(PhotoFolder, H126_DuplicatesNameTheirTwin) {
  PutPhotos(3);
  WritePng8(folder_ + "/z copy.png", DecodePhoto(folder_ + "/p1.jpg").image);
  const IngestResult result = Ingest();
  EXPECT_EQ(result.photos.size(), 3u);
  EXPECT_EQ(testing::WhyNot(result, "z copy.png"), "the same picture as p1.jpg");
}

TEST_F(PhotoFolder, F13_MissingFileEmptyOrWithoutPhotos) {
  const Error empty = Failure();
  EXPECT_EQ(empty.code(), ExitCode::kInput);
  EXPECT_TRUE(Contains(empty.what_failed(), "empty"));
  WriteText(folder_ + "/a.txt", "text");
  WriteText(folder_ + "/b.txt", "text");
  WriteText(folder_ + "/c.jxl", std::string("\xff\x0a....", 6));
  const Error none = Failure();
  EXPECT_EQ(none.code(), ExitCode::kInput);
  EXPECT_TRUE(Contains(none.what_failed(), "3 files, no usable photo")) << none.what();
  EXPECT_TRUE(Contains(none.what_failed(), "2 x not an image")) << none.what();
  EXPECT_TRUE(Contains(none.what_failed(), "JPEG XL is not supported")) << none.what();
  for (const char* bad : {"none", "photos/a.txt"}) {
    EXPECT_REGRADE_ERROR(IngestPhotos(scratch_ / bad, staging_, {}, {}), ExitCode::kInput,
                         bad[0] == 'n' ? "no such folder" : "a file");
  }
}

TEST_F(PhotoFolder, OneOrTwoPhotosAreRefused) {
  PutPhotos(2);
  const Error error = Failure();
  EXPECT_EQ(error.code(), ExitCode::kScene);
  EXPECT_TRUE(Contains(error.what_failed(), "2 photos")) << error.what();
}

TEST_F(PhotoFolder, HiddenFilesAreIgnored) {
  PutPhotos(3);
  PutPhoto(".p9.jpg", 9);
  PutPhoto(".trash/p8.jpg", 8);
  const IngestResult result = Ingest();
  EXPECT_EQ(result.statuses.size(), 3u);
  EXPECT_EQ(result.hidden, 2);
}

TEST_F(PhotoFolder, H146_AlphaIsCompositedOnWhiteAndStaged) {
  PutPhotos(3);
  Image cut_out = Photo(80, 70, 5, 4);
  for (int i = 0; i < 80 * 70; ++i) cut_out.pixels[4 * i + 3] = i % 2 ? 1.f : 0.f;
  WritePng8(folder_ + "/a.png", cut_out);
  const IngestResult result = Ingest();
  ASSERT_EQ(result.photos[0].file, "a.png");
  const Image staged = ReadImage(staging_ + "/00000.png");
  EXPECT_EQ(staged.channels, 3);
  EXPECT_EQ(staged.pixels[0], 1.f);
  const Image alpha = ReadImage(staging_ + "/00000.alpha.png");
  EXPECT_EQ(alpha.channels, 1);
  EXPECT_EQ(alpha.pixels[0], 0.f);
  EXPECT_EQ(alpha.pixels[1], 1.f);
  ASSERT_EQ(result.notices.size(), 1u);
  EXPECT_TRUE(Contains(result.notices[0], "white"));
}

TEST_F(PhotoFolder, H141_StagedPhotosAreUprightWithTheirFocalLength) {
  PutPhotos(3);
  WriteText(folder_ + "/q.jpg",
            WithSegment(EncodeJpeg(Photo(96, 64, 7), 90), 0xe1, ExifBlock(6, 28)));
  const StagedPhoto photo = Ingest().photos[3];
  EXPECT_EQ(photo.width, 64);
  EXPECT_EQ(photo.height, 96);
  EXPECT_NEAR(photo.exif_focal_px, 28 / 36.0 * 96, 1e-6);
  EXPECT_EQ(ReadImage(photo.path).height, 96);
}

TEST_F(PhotoFolder, AnotherCallRewritesOnlyWhatChanged) {
  PutPhotos(4);
  const IngestResult first = Ingest();
  const auto long_ago = fs::file_time_type::clock::now() - std::chrono::hours(5);
  for (const StagedPhoto& photo : first.photos) fs::last_write_time(photo.path, long_ago);
  PutPhoto("p2.jpg", 77);
  fs::remove(folder_ + "/p3.jpg");
  WriteText(staging_ + "/notes.txt", "not ours");
  const IngestResult second = Ingest();
  EXPECT_EQ(fs::last_write_time(staging_ + "/00001.png"), long_ago);
  EXPECT_NE(fs::last_write_time(staging_ + "/00002.png"), long_ago);
  EXPECT_FALSE(fs::exists(staging_ + "/00003.png")) << "a leftover of the first call";
  EXPECT_TRUE(fs::exists(staging_ + "/notes.txt"));
  EXPECT_NE(first.fingerprint, second.fingerprint);
  EXPECT_EQ(second.fingerprint, Ingest().fingerprint);
}

TEST_F(PhotoFolder, F15_FingerprintSeesAChangedPixelAndAName) {
  PutPhotos(3);
  const std::string before = Ingest().fingerprint;
  fs::rename(folder_ + "/p2.jpg", folder_ + "/p3.jpg");
  EXPECT_NE(Ingest().fingerprint, before);
  fs::rename(folder_ + "/p3.jpg", folder_ + "/p2.jpg");
  EXPECT_EQ(Ingest().fingerprint, before);
  Image photo = DecodePhoto(folder_ + "/p2.jpg").image;
  WritePng8(folder_ + "/p2.jpg", photo);  // the same pixels in other bytes
  EXPECT_EQ(Ingest().fingerprint, before);
  photo.pixels[100] = photo.pixels[100] > 0.5f ? 0.f : 1.f;
  WritePng8(folder_ + "/p2.jpg", photo);
  EXPECT_NE(Ingest().fingerprint, before);
}

TEST_F(PhotoFolder, StopsOnRequest) {
  PutPhotos(5);
  int calls = 0;
  const auto stop_at_third = [&](const Progress&) {
    return ++calls == 3 ? LoopControl::kStop : LoopControl::kContinue;
  };
  EXPECT_THROW(IngestPhotos(folder_, staging_, {}, stop_at_third), Interrupted);
  EXPECT_EQ(calls, 3);
}

TEST_F(PhotoFolder, F14_AVanishedDriveIsNotADamagedPhoto) {
  PutPhotos(4);
  drive_is_gone = true;
  const Error error = Failure();
  drive_is_gone = false;
  EXPECT_EQ(error.code(), ExitCode::kResources);
  EXPECT_EQ(error.where(), folder_ + "/p0.jpg");
  EXPECT_TRUE(Contains(error.what_failed(), "Input/output error")) << error.what();
}

TEST_F(PhotoFolder, F14_ThousandsOfOtherFiles) {
  PutPhotos(3);
  for (int i = 0; i < 3000; ++i) WriteText(folder_ + "/log/" + std::to_string(i), "x");
  const IngestResult result = Ingest();
  EXPECT_EQ(result.photos.size(), 3u);
  EXPECT_EQ(result.statuses.size(), 3003u);
  EXPECT_TRUE(result.notices.empty());
}

}  // namespace
}  // namespace regrade
