#include "perception/frame_source.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <opencv2/videoio/registry.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "perception/openable.h"

namespace interneuron::perception {

namespace fs = std::filesystem;

class FrameSource::Reader {
 public:
  virtual ~Reader() = default;
  // The next picture; nothing at the end.
  virtual std::optional<cv::Mat> read() = 0;
  // Begins again; false for what has no beginning.
  virtual bool rewind() = 0;
  virtual bool live() const = 0;
};

namespace {

constexpr std::string_view kRemedy =
    "give --video FILE, FOLDER or camera:N, or run scripts/fetch_data.sh";
// The longest side in pixels that a message can say (codec.h).
constexpr int kMaxPictureSide = 65535;
constexpr std::array<std::string_view, 9> kPictureSuffixes = {
    ".bmp", ".jpeg", ".jpg", ".pgm", ".png", ".ppm", ".tif", ".tiff", ".webp"};

[[noreturn]] void fail(std::string_view kind, const std::string& name, const std::string& what) {
  throw InputError(std::string(kind) + " '" + name + "': " + what + "; " + std::string(kRemedy));
}

// OpenCV reports on stderr what we report ourselves, in one line and with a remedy.
class QuietOpenCv {
 public:
  QuietOpenCv() : before_(cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT)) {}
  ~QuietOpenCv() { cv::utils::logging::setLogLevel(before_); }
  QuietOpenCv(const QuietOpenCv&) = delete;
  QuietOpenCv& operator=(const QuietOpenCv&) = delete;

 private:
  cv::utils::logging::LogLevel before_;
};

bool is_picture(const fs::path& path) {
  std::string suffix = path.extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(kPictureSuffixes.begin(), kPictureSuffixes.end(), suffix) !=
         kPictureSuffixes.end();
}

class PictureReader : public FrameSource::Reader {
 public:
  explicit PictureReader(std::vector<fs::path> files) : files_(std::move(files)) {}

  std::optional<cv::Mat> read() override {
    if (next_ == files_.size()) return {};
    const std::string name = files_[next_++].string();
    cv::Mat picture;
    try {
      const QuietOpenCv quiet;
      picture = cv::imread(name, cv::IMREAD_COLOR);
    } catch (const cv::Exception&) {
      picture.release();  // a header OpenCV refuses, such as one of absurd size
    }
    if (picture.empty()) check_openable("picture", name);
    if (picture.empty()) fail("picture", name, "cannot be read as a picture");
    if (std::max(picture.cols, picture.rows) > kMaxPictureSide)
      fail("picture", name, "is too large");
    return picture;
  }
  bool rewind() override {
    next_ = 0;
    return true;
  }
  bool live() const override { return false; }

 private:
  std::vector<fs::path> files_;
  std::size_t next_ = 0;
};

// FFmpeg where OpenCV has it. CAP_ANY would go on to try GStreamer's plugins on every bad file,
// which load libraries, take long and leak.
int file_api() {
  return cv::videoio_registry::hasBackend(cv::CAP_FFMPEG) ? cv::CAP_FFMPEG : cv::CAP_ANY;
}

class VideoReader : public FrameSource::Reader {
 public:
  VideoReader(std::string kind, std::string name, int api, bool live)
      : kind_(std::move(kind)), name_(std::move(name)), api_(api), live_(live) {
    if (!open()) fail(kind_, name_, "cannot be opened");
  }

  std::optional<cv::Mat> read() override {
    cv::Mat picture;  // a new one each time: the caller keeps the last
    try {
      if (!capture_.read(picture) || picture.type() != CV_8UC3) return {};
    } catch (const cv::Exception&) {
      return {};  // a damaged file ends where it cannot be decoded any more
    }
    return picture;
  }
  // Opened anew, since seeking is inexact for many codecs.
  bool rewind() override { return !live_ && open(); }
  bool live() const override { return live_; }

 private:
  bool open() {
    const QuietOpenCv quiet;
    try {
      return capture_.open(name_, api_);
    } catch (const cv::Exception&) {
      return false;
    }
  }

  std::string kind_;
  std::string name_;
  int api_;
  bool live_;
  cv::VideoCapture capture_;
};

std::unique_ptr<FrameSource::Reader> open_folder(const std::string& name) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator it(name, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    if (is_picture(it->path()) && it->is_regular_file(ignored)) files.push_back(it->path());
  }
  if (error) check_openable("folder", name);
  if (error) fail("folder", name, error.message());
  if (files.empty()) fail("folder", name, "holds no picture (.png, .jpg, .bmp, .ppm, .tif, .webp)");
  std::sort(files.begin(), files.end());
  return std::make_unique<PictureReader>(std::move(files));
}

std::unique_ptr<FrameSource::Reader> open_camera(const std::string& spec,
                                                 const std::string& device) {
  std::error_code error;
  if (!fs::exists(device, error)) fail("camera", spec, "no such device");
  if (!fs::is_character_file(device, error)) fail("camera", spec, "is no camera");
  return std::make_unique<VideoReader>("camera", device, cv::CAP_V4L2, true);
}

std::unique_ptr<FrameSource::Reader> open_reader(const std::string& spec) {
  constexpr std::string_view kCamera = "camera:";
  if (spec.starts_with(kCamera)) {
    const std::string number = spec.substr(kCamera.size());
    const bool digits = !number.empty() && std::all_of(number.begin(), number.end(),
                                                       [](char c) { return c >= '0' && c <= '9'; });
    if (!digits) fail("camera", spec, "no camera number");
    return open_camera(spec, "/dev/video" + number);
  }
  if (spec.starts_with("/dev/")) return open_camera(spec, spec);
  if (spec.find("://") != std::string::npos) {
    return std::make_unique<VideoReader>("stream", spec, file_api(), true);
  }
  std::error_code error;
  const fs::file_status status = fs::status(spec, error);
  if (status.type() == fs::file_type::not_found) fail("video", spec, "no such file");
  if (error) fail("video", spec, error.message());
  if (fs::is_directory(status)) return open_folder(spec);
  if (!fs::is_regular_file(status)) fail("video", spec, "is neither a file nor a folder");
  check_openable("video", spec);
  if (is_picture(spec)) return std::make_unique<PictureReader>(std::vector<fs::path>{spec});
  return std::make_unique<VideoReader>("video", spec, file_api(), false);
}

}  // namespace

FrameSource::FrameSource(const std::string& spec, FrameSourceOptions options)
    : reader_(open_reader(spec)), options_(options), pending_(reader_->read()) {
  if (!pending_) fail(reader_->live() ? "stream" : "video", spec, "holds no picture");
}

FrameSource::~FrameSource() = default;
FrameSource::FrameSource(FrameSource&&) noexcept = default;
FrameSource& FrameSource::operator=(FrameSource&&) noexcept = default;

std::optional<Frame> FrameSource::next() {
  std::optional<cv::Mat> picture =
      pending_ ? std::exchange(pending_, std::nullopt) : read_looping();
  if (!picture) return {};
  return Frame{.bgr = std::move(*picture), .index = next_index_++};
}

std::optional<cv::Mat> FrameSource::read_looping() {
  std::optional<cv::Mat> picture = reader_->read();
  if (picture || !options_.loop || !reader_->rewind()) return picture;
  next_index_ = 0;
  return reader_->read();
}

bool FrameSource::live() const { return reader_->live(); }

}  // namespace interneuron::perception
