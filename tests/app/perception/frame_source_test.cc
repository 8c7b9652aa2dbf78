#include "app/perception/frame_source.h"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "support.h"

namespace interneuron::perception::frame_source_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr int kSide = 64;  // pixels

// A picture whose grey value tells which one it is.
cv::Mat numbered(int number) { return {kSide, kSide, CV_8UC3, cv::Scalar::all(20 + 40 * number)}; }

int number_of(const Frame& frame) {
  return static_cast<int>(std::lround((cv::mean(frame.bgr)[0] - 20) / 40));
}

void write_folder(const std::filesystem::path& folder, int pictures) {
  std::filesystem::create_directories(folder);
  for (int i = pictures; i-- > 0;) {  // written backwards: the order is by name, not by age
    cv::imwrite((folder / ("frame" + std::to_string(i) + ".png")).string(), numbered(i));
  }
}

std::string write_video(const std::filesystem::path& file, int frames) {
  cv::VideoWriter out(file.string(), cv::CAP_OPENCV_MJPEG,
                      cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 10, {kSide, kSide});
  for (int i = 0; i < frames; ++i) out.write(numbered(i));
  return file.string();
}

void expect_frames(FrameSource& source, int count) {
  for (int i = 0; i < count; ++i) {
    const auto frame = source.next();
    ASSERT_TRUE(frame) << i;
    EXPECT_EQ(frame->index, i);
    EXPECT_EQ(number_of(*frame), i);
    EXPECT_EQ(frame->bgr.type(), CV_8UC3);
  }
}

TEST(FrameSource, ReadsAFolderSortedByName) {
  const TempDir dir;
  write_folder(dir / "in", 3);
  write_text(dir / "in/notes.txt", "no picture");
  FrameSource source((dir / "in").string());
  EXPECT_FALSE(source.live());
  expect_frames(source, 3);
  EXPECT_FALSE(source.next());
  EXPECT_FALSE(source.next());
}

TEST(FrameSource, LoopsAFolder) {
  const TempDir dir;
  write_folder(dir / "in", 2);
  FrameSource source((dir / "in").string(), {.loop = true});
  for (int round = 0; round < 3; ++round) expect_frames(source, 2);
}

TEST(FrameSource, ReadsOnePicture) {
  const TempDir dir;
  write_folder(dir / "in", 4);
  FrameSource source((dir / "in/frame2.png").string());
  const auto frame = source.next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(number_of(*frame), 2);
  EXPECT_FALSE(source.next());  // not frame3.png, as OpenCV's numbered sequences would go on
}

TEST(FrameSource, ReadsAVideo) {
  const TempDir dir;
  FrameSource source(write_video(dir / "in.avi", 4));
  expect_frames(source, 4);
  EXPECT_FALSE(source.next());
}

TEST(FrameSource, LoopsAVideo) {
  const TempDir dir;
  FrameSource source(write_video(dir / "in.avi", 3), {.loop = true});
  for (int round = 0; round < 3; ++round) expect_frames(source, 3);
}

TEST(FrameSource, FramesAreTheCallersOwn) {
  const TempDir dir;
  FrameSource source(write_video(dir / "in.avi", 3));
  const auto first = source.next();
  source.next();
  FrameSource moved = std::move(source);
  EXPECT_EQ(number_of(*moved.next()), 2);
  EXPECT_EQ(number_of(*first), 0);
}

TEST(FrameSource, MissingFileIsNamedWithTheRemedy) {
  EXPECT_EQ(complaint([] { FrameSource("x.avi"); }),
            "video 'x.avi': no such file; give --video FILE, FOLDER or camera:N, or run "
            "scripts/fetch_data.sh");
}

TEST(FrameSource, BadInputsAreOneLineEach) {
  const TempDir dir;
  write_text(dir / "empty.avi", "");
  write_text(dir / "text.avi", std::string(5000, 'x'));
  write_text(dir / "bad.png", "no picture");
  std::filesystem::create_directories(dir / "nothing");
  for (const std::string& spec :
       {(dir / "empty.avi").string(), (dir / "text.avi").string(), (dir / "bad.png").string(),
        (dir / "nothing").string(), std::string("camera:99"), std::string("camera:"),
        std::string("camera:-1"), std::string("/dev/null"), std::string("/dev/none"),
        std::string(""), std::string("file:///none.avi")}) {
    EXPECT_THAT(complaint([&] { FrameSource source(spec); }),
                AllOf(HasSubstr("'" + spec), HasSubstr("--video"), Not(HasSubstr("\n"))))
        << spec;
  }
}

TEST(FrameSource, UnreadablePictureLaterIsNamed) {
  const TempDir dir;
  write_folder(dir / "in", 1);
  write_text(dir / "in/frame1.png", "damaged");
  FrameSource source((dir / "in").string());
  EXPECT_TRUE(source.next());
  EXPECT_THAT(complaint([&] { source.next(); }), HasSubstr("frame1.png"));
}

TEST(FrameSource, TruncatedVideoEnds) {
  const TempDir dir;
  const std::string file = write_video(dir / "in.avi", 20);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  int frames = 0;
  EXPECT_EQ(complaint([&] {
              FrameSource source(file);
              while (source.next()) ++frames;
            }),
            "");
  EXPECT_GT(frames, 0);
  EXPECT_LT(frames, 20);
}

}  // namespace
}  // namespace interneuron::perception::frame_source_test
