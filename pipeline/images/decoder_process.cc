#include "pipeline/images/decoder_process.h"

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <stdexcept>
#include <utility>

#include "kernels/base/clock.h"
#include "kernels/base/error.h"
#include "kernels/process/worker_process.h"
#include "pipeline/images/decoder_message.h"

namespace regrade {
namespace {

constexpr size_t kMostIdle = 2;  // ingest decodes one picture while it reads another
constexpr double kBytesPerSecond = 1e6;
constexpr char kDamaged[] =
    "the file is damaged: copy it again from its source, or convert it with another program";

// A child. It is idle, or at work on one file.
struct Decoder {
  explicit Decoder(const DecoderProcess& settings)
      : settings(settings), worker(settings.command) {}

  const DecoderProcess settings;
  WorkerProcess worker;
  bool used = false;  // has been given a file before
};

// Of a file: what it is blamed with if the child does not answer.
class Conversation {
 public:
  Conversation(std::unique_ptr<Decoder> decoder, const std::string& path)
      : path_(path), decoder_(std::move(decoder)) {
    std::error_code none;
    const std::uintmax_t bytes = std::filesystem::file_size(path, none);
    seconds_ = decoder_->settings.seconds +
               (none ? 0.0 : static_cast<double>(bytes) / kBytesPerSecond);
  }

  // False if the child has died; Error(kInput) if it is too late or says so itself. After an
  // exception of any kind the child is not used again.
  bool Ask(const MessageWriter& request) {
    if (decoder_ == nullptr) Refuse(ended_);
    until_ = ClockSeconds() + seconds_;
    std::unique_ptr<Decoder> decoder = std::move(decoder_);
    const uint64_t size = request.bytes().size();
    uint64_t reply_size = 0;
    const bool alive = Went(decoder->worker.Send(&size, sizeof size, until_)) &&
                       Went(decoder->worker.Send(request.bytes().data(), size, until_)) &&
                       Went(decoder->worker.Receive(&reply_size, sizeof reply_size, until_));
    REGRADE_CHECK(reply_size <= kLongestFields);
    fields_.assign(reply_size, '\0');
    if (!alive || !Went(decoder->worker.Receive(fields_.data(), reply_size, until_))) {
      ended_ = "crashed its decoder (" + decoder->worker.End() + ")";
      return false;
    }
    reply_ = MessageReader(fields_);
    const auto kind = reply_.Take<DecoderReply>();
    if (kind != DecoderReply::kBug) decoder_ = std::move(decoder);
    ThrowWhatItSays(kind);
    return true;
  }
  // For a child that must not die.
  void AskOrRefuse(const MessageWriter& request) {
    if (!Ask(request)) Refuse(ended_);
  }

  MessageReader* reply() { return &reply_; }
  void ReceiveValues(Image* image) {
    std::unique_ptr<Decoder> decoder = std::move(decoder_);
    if (!Went(decoder->worker.Receive(image->pixels.data(),
                                      image->pixels.size() * sizeof(float), until_))) {
      ended_ = "crashed its decoder (" + decoder->worker.End() + ")";
      Refuse(ended_);
    }
    decoder_ = std::move(decoder);
  }

  std::unique_ptr<Decoder> Release() { return std::move(decoder_); }
  [[noreturn]] void RefuseAsEnded() const { Refuse(ended_); }

 private:
  [[noreturn]] void Refuse(const std::string& why) const {
    throw InputError(why, path_, kDamaged);
  }
  bool Went(WorkerProcess::Outcome outcome) {
    if (outcome == WorkerProcess::Outcome::kLate) {
      ended_ = Format("was not decoded within %.0f s", seconds_);
      Refuse(ended_);
    }
    return outcome == WorkerProcess::Outcome::kDone;
  }
  void ThrowWhatItSays(DecoderReply kind) {
    if (kind == DecoderReply::kDone) return;
    if (kind == DecoderReply::kError) {
      const auto code = static_cast<ExitCode>(reply_.Take<int>());
      const std::string what = reply_.TakeText(), where = reply_.TakeText();
      throw Error(code, what, where, reply_.TakeText());
    }
    if (kind == DecoderReply::kNoResources)
      throw ResourceError("out of memory", path_, "raise the limit on memory (ulimit -v)");
    if (kind == DecoderReply::kNoMemory)
      throw InputError(
          Concat("needs more than ", reply_.Take<int64_t>() >> 20, " MiB to be decoded"), path_,
          "the file is damaged, or too large for this machine: scale it down");
    throw std::runtime_error("the decoder: " + reply_.TakeText());
  }

  std::string path_;
  std::unique_ptr<Decoder> decoder_;
  double seconds_ = 0, until_ = 0;
  std::string fields_;
  MessageReader reply_{""};
  std::string ended_;
};

// The children that are not at work.
class Pool {
 public:
  void Use(const DecoderProcess& process) {
    const std::lock_guard lock(mutex_);
    process_ = process;
    idle_.clear();
  }
  bool On() {
    const std::lock_guard lock(mutex_);
    return !process_.command.empty();
  }
  int64_t memory_bytes() {
    const std::lock_guard lock(mutex_);
    return process_.memory_bytes;
  }
  std::unique_ptr<Decoder> Start() {
    const std::lock_guard lock(mutex_);
    return std::make_unique<Decoder>(process_);
  }
  std::unique_ptr<Decoder> Get() {
    {
      const std::lock_guard lock(mutex_);
      while (!idle_.empty()) {
        std::unique_ptr<Decoder> decoder = std::move(idle_.back());
        idle_.pop_back();
        if (decoder->worker.IsIdle()) return decoder;
      }
    }
    return Start();
  }
  void GiveBack(std::unique_ptr<Decoder> decoder) {
    if (decoder == nullptr) return;
    decoder->used = true;
    const std::lock_guard lock(mutex_);
    if (idle_.size() < kMostIdle && decoder->settings.command == process_.command)
      idle_.push_back(std::move(decoder));
  }

 private:
  std::mutex mutex_;
  DecoderProcess process_;
  std::vector<std::unique_ptr<Decoder>> idle_;
};

Pool& Children() {
  static Pool pool;
  return pool;
}

// The answer to the first question about a file, by a child that may have died of another one.
std::unique_ptr<Conversation> Begin(const std::string& path, const MessageWriter& request) {
  std::unique_ptr<Decoder> decoder = Children().Get();
  bool used = decoder->used;
  for (;;) {
    auto talk = std::make_unique<Conversation>(std::move(decoder), path);
    try {
      if (talk->Ask(request)) return talk;
    } catch (const Error&) {
      Children().GiveBack(talk->Release());
      throw;
    }
    if (!used) talk->RefuseAsEnded();
    decoder = Children().Start();
    used = false;
  }
}

MessageWriter RequestFor(DecoderRequest kind, const std::string& path) {
  MessageWriter request;
  request.Put(kind);
  request.Put(Children().memory_bytes());
  request.PutText(path);
  return request;
}

class FilmApart final : public FilmSource {
 public:
  FilmApart(const std::string& path, const VideoLimits& limits) {
    MessageWriter request = RequestFor(DecoderRequest::kFilm, path);
    request.Put(limits);
    talk_ = Begin(path, request);
    info_ = TakeInfo(talk_->reply());
  }
  ~FilmApart() override {
    try {
      MessageWriter request;
      request.Put(DecoderRequest::kClose);
      if (talk_->Ask(request)) Children().GiveBack(talk_->Release());
    } catch (const std::exception&) {
      // The child is ended.
    }
  }

  const VideoInfo& info() const override { return info_; }
  const FrameInfo& frame() const override { return frame_; }
  bool Next() override {
    MessageWriter request;
    request.Put(DecoderRequest::kNext);
    talk_->AskOrRefuse(request);
    const bool any = talk_->reply()->Take<bool>();
    frame_ = talk_->reply()->Take<FrameInfo>();
    return any;
  }
  Image Picture() override {
    MessageWriter request;
    request.Put(DecoderRequest::kFramePicture);
    return Answer(request);
  }
  Image Grey(int longer_side) override {
    MessageWriter request;
    request.Put(DecoderRequest::kFrameGrey);
    request.Put(longer_side);
    return Answer(request);
  }

 private:
  Image Answer(const MessageWriter& request) {
    talk_->AskOrRefuse(request);
    Image image = TakeSize(talk_->reply());
    talk_->ReceiveValues(&image);
    return image;
  }

  std::unique_ptr<Conversation> talk_;
  VideoInfo info_;
  FrameInfo frame_;
};

}  // namespace

void DecodeApart(const DecoderProcess& process) { Children().Use(process); }
bool DecodesApart() { return Children().On(); }

StoredPicture DecodePictureApart(const std::string& path, const DecodeLimits& limits) {
  MessageWriter request = RequestFor(DecoderRequest::kPicture, path);
  request.Put(limits);
  const std::unique_ptr<Conversation> talk = Begin(path, request);
  StoredPicture picture = TakePicture(talk->reply());
  talk->ReceiveValues(&picture.image);
  Children().GiveBack(talk->Release());
  return picture;
}

std::unique_ptr<FilmSource> OpenFilmApart(const std::string& path, const VideoLimits& limits) {
  return std::make_unique<FilmApart>(path, limits);
}

}  // namespace regrade
