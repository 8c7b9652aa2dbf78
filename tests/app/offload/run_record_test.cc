// A vehicle that runs for days keeps a tally, not its rounds.
#include "app/offload/run_record.h"

#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <csignal>
#include <thread>

#include "app/perception/codec.h"
#include "app/process/failure.h"
#include "app/process/private_folder.h"

namespace interneuron::offload::run_record_test {
namespace {

using namespace std::chrono_literals;

constexpr Duration kDeadline = 130ms;

// What the failure of writing says; empty without one.
std::string failure_of_writing(RunRecord& record, const records::RunInfo& info) {
  try {
    record.write(info);
  } catch (const process::Failure& failure) {
    EXPECT_EQ(failure.code(), process::kFailed);
    return failure.what();
  }
  return "";
}

class Recording : public testing::Test {
 protected:
  RoundDone done(std::uint32_t round, Duration e2e = 90ms) {
    perception::Result result{.boxes = {{1, 2, 3, 4, 0.9F}}};
    RoundDone event;
    event.round.round = RoundId{round};
    event.t0 = TimePoint{round * 100ms};
    event.outcome = Outcome::kRemote;
    event.e2e = e2e;
    event.age_rounds = 0;
    event.result = perception::encode_result(result);
    return event;
  }
  void run(RunRecord& record, std::uint32_t rounds) {
    for (std::uint32_t i = 0; i < rounds; ++i) {
      record.begun(i, frame_);
      record.planned(i, "raw:a");
      record.done(done(i), kDeadline);
    }
  }
  records::RunInfo info_ = [] {
    records::RunInfo info;
    info.deadline = kDeadline;
    return info;
  }();
  perception::Frame frame_{cv::Mat(48, 64, CV_8UC3, cv::Scalar(1, 2, 3)), 0};
};

TEST_F(Recording, WithoutAFolderNothingIsKeptOfRoundsThatAreOver) {
  RunRecord record({.guard = "budget"});
  record.open();
  run(record, 50'000);
  EXPECT_EQ(record.kept(), 0U);
  const records::Json s = record.write(info_);
  EXPECT_EQ(s["rounds"], 50'000);
  EXPECT_EQ(s["on_time"], 50'000);
  EXPECT_EQ(s["e2e_ms"]["p99"], 90);
}

TEST_F(Recording, WithAFolderRowsGoToTheFileAndAFewAreKeptForThePlot) {
  const process::PrivateFolder folder("interneuron-record-test");
  const auto rounds = static_cast<std::uint32_t>(3 * RunRecord::kMaxDrawn);
  RunRecord record({.guard = "budget", .out = folder / "out"});
  record.open();
  run(record, rounds);
  EXPECT_LE(record.kept(), 2 * RunRecord::kMaxDrawn);
  EXPECT_GE(record.kept(), RunRecord::kMaxDrawn);
  const records::Json s = record.write(info_);
  const auto rows = records::read_csv(folder / "out/rounds.csv");
  EXPECT_EQ(rows.size(), rounds);
  EXPECT_EQ(records::summarise(rows, info_).dump(), s.dump());
  for (const char* name : {"summary.json", "frame.png"}) {
    EXPECT_TRUE(std::filesystem::exists(folder / "out" / name)) << name;
  }
}

TEST_F(Recording, RoundsThatEndInAnotherOrderAreWrittenInTheirOwn) {
  const process::PrivateFolder folder("interneuron-record-test");
  RunRecord record({.guard = "budget", .out = folder.path()});
  record.open();
  for (std::uint32_t i = 0; i < 4; ++i) record.begun(i, frame_);
  for (const std::uint32_t i : {2U, 0U, 1U}) record.done(done(i), kDeadline);
  EXPECT_EQ(record.kept(), 1U + 3U);
  record.drop_undecided();
  record.write(info_);
  const auto rows = records::read_csv(folder / "rounds.csv");
  ASSERT_EQ(rows.size(), 3U);
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_EQ(rows[i].round, i);
}

TEST_F(Recording, ARecordThatIsNotWrittenLeavesNothing) {
  const process::PrivateFolder folder("interneuron-record-test");
  {
    RunRecord record({.guard = "budget", .out = folder / "out"});
    record.open();
    run(record, 10);
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

// The limit of a file's size stands for a full disk, which needs a file system of its own.
TEST_F(Recording, AFileThatCannotGrowIsNamedAndNothingIsLeft) {
  const process::PrivateFolder folder("interneuron-record-test");
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit small{100'000, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  {
    RunRecord record({.guard = "budget", .out = folder / "out"});
    record.open();
    run(record, 20'000);
    const std::string what = failure_of_writing(record, info_);
    EXPECT_NE(what.find("rounds.csv': File too large"), std::string::npos) << what;
  }
  ::setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_FALSE(std::filesystem::exists(folder / "out"));
}

// A disk of 512 KiB, which the picture of a noisy frame does not fit on.
TEST_F(Recording, OnAFullDiskThePictureIsNamedAndNoneIsLeft) {
  const process::PrivateFolder folder("interneuron-record-test");
  cv::Mat noise(576, 768, CV_8UC3);
  cv::randu(noise, 0, 255);
  frame_.bgr = noise;
  bool mounted = false;
  std::string what;
  bool left = true;
  std::thread([&] {
    mounted = ::unshare(CLONE_NEWNS) == 0 &&
              ::mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) == 0 &&
              ::mount("tmpfs", folder.path().c_str(), "tmpfs", 0, "size=512k") == 0;
    if (!mounted) return;
    auto record =
        std::make_unique<RunRecord>(RunRecord::Options{.guard = "budget", .out = folder / "out"});
    record->open();
    run(*record, 10);
    what = failure_of_writing(*record, info_);
    record.reset();
    left = std::filesystem::exists(folder / "out");
  }).join();
  if (!mounted) GTEST_SKIP() << "needs the privilege to mount";
  EXPECT_NE(what.find("frame.png': No space left on device; make room"), std::string::npos) << what;
  EXPECT_FALSE(left);
}

}  // namespace
}  // namespace interneuron::offload::run_record_test
