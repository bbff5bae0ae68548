#include "pipeline/images/decoder_server.h"

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <memory>
#include <new>
#include <string>
#include <thread>

#include "kernels/base/error.h"
#include "kernels/process/worker_process.h"
#include "pipeline/images/decoder_message.h"
#include "pipeline/images/film_decoder.h"

namespace regrade {
namespace {

constexpr int kIdleMs = 10'000;
constexpr unsigned kMostThreads = 8;  // each takes address space
// What libraries, their code and small tables take at most, and each thread of theirs.
constexpr int64_t kLibraryBytes = int64_t{2} << 30, kThreadBytes = int64_t{16} << 20;
// While a pixel is decoded: 16 bytes as four floats, twice where it is turned upright, and what
// is stored of it, in several forms. A film's decoder keeps up to 16 frames, and as many as it
// has threads.
constexpr int64_t kPicturePixelBytes = 64, kFilmPixelBytes = 128;
// With less, no file is to blame if it cannot be decoded.
constexpr int64_t kLittleBytes = int64_t{1} << 30;

int64_t AddressSpace() {
  int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * ::sysconf(_SC_PAGESIZE);
}

// By the limits with which the program was started.
bool HasLittleMemory() {
  rlimit limit{};
  return ::getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_max != RLIM_INFINITY &&
         limit.rlim_max < static_cast<rlim_t>(AddressSpace() + kLittleBytes);
}

void LimitAddressSpace(int64_t bytes) {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0) return;
  // Infinity is the largest number.
  limit.rlim_cur = std::min(static_cast<rlim_t>(AddressSpace() + bytes), limit.rlim_max);
  ::setrlimit(RLIMIT_AS, &limit);
#else
  (void)bytes;
#endif
}

class Server {
 public:
  // False if the parent is gone.
  bool Answer() {
    uint64_t size = 0;
    if (!ReceiveFromStarter(&size, sizeof size) || size > kLongestFields) return false;
    std::string fields(size, '\0');
    if (!ReceiveFromStarter(fields.data(), size)) return false;
    MessageReader request(fields);
    MessageWriter reply;
    Image image;
    try {
      MessageWriter done;
      done.Put(DecoderReply::kDone);
      image = Do(&request, &done);
      reply = done;
    } catch (const Error& error) {
      reply.Put(DecoderReply::kError);
      reply.Put(static_cast<int>(error.code()));
      for (const std::string& text : {error.what_failed(), error.where(), error.hint()})
        reply.PutText(text);
    } catch (const std::bad_alloc&) {
      reply.Put(HasLittleMemory() ? DecoderReply::kNoResources : DecoderReply::kNoMemory);
      reply.Put(memory_);
    } catch (const std::exception& error) {
      reply.Put(DecoderReply::kBug);
      reply.PutText(error.what());
    }
    size = reply.bytes().size();
    return SendToStarter(&size, sizeof size) && SendToStarter(reply.bytes().data(), size) &&
           SendToStarter(image.pixels.data(), image.pixels.size() * sizeof(float));
  }
  bool has_film() const { return film_ != nullptr; }

 private:
  // Puts the fields of the reply, and returns the picture that follows them, or none.
  Image Do(MessageReader* request, MessageWriter* reply) {
    const auto kind = request->Take<DecoderRequest>();
    if (kind == DecoderRequest::kPicture || kind == DecoderRequest::kFilm) {
      film_.reset();
      const int64_t memory = request->Take<int64_t>();
      const std::string path = request->TakeText();
      if (kind == DecoderRequest::kPicture)
        return DecodePicture(path, request->Take<DecodeLimits>(), memory, reply);
      return OpenFilm(path, request->Take<VideoLimits>(), memory, reply);
    }
    if (kind == DecoderRequest::kClose) film_.reset();
    if (kind == DecoderRequest::kClose) return {};
    REGRADE_CHECK(film_ != nullptr);
    if (kind == DecoderRequest::kNext) {
      reply->Put(film_->Next());
      reply->Put(film_->frame());
      return {};
    }
    Image image = kind == DecoderRequest::kFrameGrey ? film_->Grey(request->Take<int>())
                                                     : film_->Picture();
    PutSize(image, reply);
    return image;
  }

  Image DecodePicture(const std::string& path, const DecodeLimits& limits, int64_t memory,
                      MessageWriter* reply) {
    Limit(path, limits.max_pixels, kPicturePixelBytes, memory);
    StoredPicture picture = regrade::DecodePicture(path, limits);
    PutPicture(picture, reply);
    return std::move(picture.image);
  }

  Image OpenFilm(const std::string& path, const VideoLimits& limits, int64_t memory,
                 MessageWriter* reply) {
    Limit(path, limits.max_pixels, kFilmPixelBytes, memory);
    film_ = std::make_unique<FilmDecoder>(path, limits);
    PutInfo(film_->info(), reply);
    return {};
  }

  void Limit(const std::string& path, int64_t max_pixels, int64_t pixel_bytes, int64_t memory) {
    std::error_code none;
    const auto size = std::filesystem::file_size(path, none);
    memory_ = memory > 0 ? memory
                         : MemoryToDecode(max_pixels, none ? 0 : static_cast<int64_t>(size),
                                          pixel_bytes);
    LimitAddressSpace(memory_);
  }

  std::unique_ptr<FilmDecoder> film_;
  int64_t memory_ = 0;
};

}  // namespace

int64_t MemoryToDecode(int64_t max_pixels, int64_t file_bytes, int64_t pixel_bytes) {
  const int64_t pixels = std::min(max_pixels, MostPixelsOf(file_bytes));
  const int64_t wanted =
      kLibraryBytes + kThreadBytes * std::thread::hardware_concurrency() + pixels * pixel_bytes;
  const int64_t machine = ::sysconf(_SC_PHYS_PAGES) * ::sysconf(_SC_PAGESIZE);
  return machine > 0 ? std::min(wanted, machine) : wanted;
}

void ServeDecoding() {
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::mallopt(M_ARENA_MAX, 2);  // each reserves address space
  LimitDecodingThreads(HasLittleMemory()
                           ? 1
                           : static_cast<int>(std::clamp(std::thread::hardware_concurrency(),
                                                         1u, kMostThreads)));
  EndWithStarter();
  Server server;
  while ((server.has_film() || AwaitStarter(kIdleMs)) && server.Answer()) {
  }
  std::_Exit(0);  // other threads may be at work
}

}  // namespace regrade
