// Files that are written whole or not at all, private folders, and programs as filters.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <functional>

#include "app/process/child.h"
#include "app/process/failure.h"
#include "app/process/private_folder.h"
#include "app/process/whole_file.h"

namespace interneuron::process::files_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The exit code and the text of the failure; 0 without one.
std::pair<int, std::string> failure(const std::function<void()>& work) {
  try {
    work();
  } catch (const Failure& f) {
    return {f.code(), f.what()};
  }
  return {0, ""};
}

std::size_t files_in(const fs::path& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder), fs::directory_iterator()));
}

// Lowers a limit of this process while it lives.
class Limit {
 public:
  Limit(int which, rlim_t value) : which_(which) {
    ::getrlimit(static_cast<__rlimit_resource>(which_), &before_);
    const rlimit lower{value, before_.rlim_max};
    ::setrlimit(static_cast<__rlimit_resource>(which_), &lower);
  }
  ~Limit() { ::setrlimit(static_cast<__rlimit_resource>(which_), &before_); }

 private:
  int which_;
  rlimit before_{};
};

rlim_t descriptors_in_use() {
  const io::FileDescriptor next(::dup(STDERR_FILENO));
  return static_cast<rlim_t>(next.get());
}

class Files : public testing::Test {
 protected:
  PrivateFolder folder_{"interneuron-files-test"};
};

TEST_F(Files, IsThereWhenItIsCommittedAndNotBefore) {
  const fs::path file = folder_ / "a'b\"c; touch x.json";
  {
    WholeFile out(file);
    out.append("one ");
    out.append(std::string(200'000, 'x'));
    EXPECT_FALSE(fs::exists(file));
    out.commit();
  }
  EXPECT_EQ(read_whole(file, kFailed).size(), 200'004U);
  EXPECT_EQ(files_in(folder_.path()), 1U);
}

TEST_F(Files, OneThatIsGivenUpLeavesWhatWasThere) {
  write_whole(folder_ / "file", "before");
  {
    WholeFile out(folder_ / "file");
    out.append("after");
  }
  EXPECT_EQ(read_whole(folder_ / "file", kFailed), "before");
  EXPECT_EQ(files_in(folder_.path()), 1U);
}

TEST_F(Files, AFileThatCannotGrowIsNamedWithTheReasonAndLeavesWhatWasThere) {
  write_whole(folder_ / "file", "before");
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  const auto [code, what] = [&] {
    const Limit limit(RLIMIT_FSIZE, 1000);
    return failure([&] { write_whole(folder_ / "file", std::string(5000, 'x')); });
  }();
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(code, kFailed);
  EXPECT_THAT(what, HasSubstr("file': File too large"));
  EXPECT_EQ(read_whole(folder_ / "file", kFailed), "before");
  EXPECT_EQ(files_in(folder_.path()), 1U);
}

TEST_F(Files, TooManyOpenFilesIsSaidWhetherOneWritesOrReads) {
  write_whole(folder_ / "file", "before");
  const Limit limit(RLIMIT_NOFILE, descriptors_in_use());
  const auto written = failure([&] { write_whole(folder_ / "new", "x"); });
  EXPECT_EQ(written.first, kFailed);
  EXPECT_THAT(written.second, HasSubstr("new': Too many open files"));
  EXPECT_THAT(written.second, HasSubstr("ulimit -n"));
  const auto read = failure([&] { read_whole(folder_ / "file", kConfiguration); });
  EXPECT_EQ(read.first, kFailed) << "nothing is wrong with the file";
  EXPECT_THAT(read.second, HasSubstr("file': Too many open files"));
}

TEST_F(Files, AFileThatIsMissingHasTheCodeOfTheCaller) {
  const auto [code, what] = failure([&] { read_whole(folder_ / "none", kConfiguration); });
  EXPECT_EQ(code, kConfiguration);
  EXPECT_THAT(what, HasSubstr("none': No such file"));
  EXPECT_THAT(failure([&] { write_whole(folder_ / "none/file", "x"); }).second,
              HasSubstr("none/file': No such file or directory; choose a folder that exists"));
}

TEST_F(Files, ADeviceIsWrittenAsItComes) {
  write_whole("/dev/null", "gone");
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  EXPECT_THAT(failure([] { write_whole("/dev/full", "x"); }).second,
              HasSubstr("'/dev/full': No space left on device"));
}

TEST_F(Files, ALinkStaysALink) {
  write_whole(folder_ / "target", "before");
  fs::create_symlink("target", folder_ / "link");
  write_whole(folder_ / "link", "after");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_EQ(read_whole(folder_ / "target", kFailed), "after");
}

TEST_F(Files, APrivateFolderIsOursAndClosed) {
  make_private_folder(folder_ / "deep/er");
  make_private_folder(folder_ / "deep/er");
  struct stat status {};
  ASSERT_EQ(::stat((folder_ / "deep/er").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0700U);
  fs::create_symlink("deep/er", folder_ / "link");
  fs::create_directory(folder_ / "open");
  fs::permissions(folder_ / "open", fs::perms::all);
  write_whole(folder_ / "file", "x");
  for (const char* name : {"link", "open", "file"}) {
    const auto [code, what] = failure([&] { make_private_folder(folder_ / name); });
    EXPECT_EQ(code, kFailed) << name;
    EXPECT_THAT(what, HasSubstr((folder_ / name).string()));
  }
  if (::geteuid() != 0) return;
  fs::create_directory(folder_ / "foreign");
  ASSERT_EQ(::chown((folder_ / "foreign").c_str(), 12345, 12345), 0);
  EXPECT_EQ(failure([&] { make_private_folder(folder_ / "foreign"); }).first, kFailed);
}

TEST_F(Files, APrivateFolderOfAProgramThatWasKilledGoesWithTheNextOne) {
  const char* before = std::getenv("TMPDIR");
  const std::string tmpdir = before != nullptr ? before : "";
  ::setenv("TMPDIR", folder_.path().c_str(), 1);
  {
    const PrivateFolder running("purpose");
    for (const char* name : {"purpose-killed", "purpose-young", "other-killed"}) {
      fs::create_directory(folder_ / name);
      write_whole(folder_ / name / "key", "x");
    }
    for (const fs::path& folder :
         {running.path(), folder_ / "purpose-killed", folder_ / "other-killed"}) {
      fs::last_write_time(folder, fs::file_time_type::clock::now() - std::chrono::hours(1));
    }
    const PrivateFolder next("purpose");
    EXPECT_FALSE(fs::exists(folder_ / "purpose-killed"));
    EXPECT_TRUE(fs::exists(folder_ / "purpose-young")) << "may not be locked yet";
    EXPECT_TRUE(fs::exists(folder_ / "other-killed")) << "of another program";
    EXPECT_TRUE(fs::exists(running.path()));
  }
  tmpdir.empty() ? ::unsetenv("TMPDIR") : ::setenv("TMPDIR", tmpdir.c_str(), 1);
}

TEST(Filter, GivesAProgramAllOfItsInputAndTakesAllOfItsOutput) {
  const std::string text(3'000'000, 'x');
  const Filtered same = filter(text, {"cat"});
  EXPECT_EQ(same.start_error, 0);
  EXPECT_EQ(same.code, 0);
  EXPECT_TRUE(same.output == text);
  EXPECT_EQ(filter("", {"sh", "-c", "exit 7"}).code, 7);
  EXPECT_EQ(filter("", {"/no-such-program-anywhere"}).start_error, ENOENT);
}

}  // namespace
}  // namespace interneuron::process::files_test
