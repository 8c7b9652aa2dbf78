// Files of keys as `keys` writes them and programs read them: whose they have to be, who else may
// touch them, what they have to hold, and that none is ever overwritten.
#include "app/settings/key_files.h"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

#include "app/process/failure.h"
#include "tests/app/cli/support.h"

namespace interneuron::settings::key_files_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The private and the public key of Alice in RFC 7748 §6.1.
constexpr const char* kAlice = "dwdtCnMYpX08FsFyUbJmRd9ML4frwJkqsXf7pR25LCo=";
constexpr const char* kAlicePublic = "hSDwCYkwp1R0i33ctD73Wg2/Og0mOBr066SpjqqbTmo=";

class KeyFiles : public testing::Test {
 protected:
  fs::path file() const { return folder_ / "key"; }
  fs::path write(const std::string& text, mode_t mode = 0600) const {
    std::ofstream(file()) << text;
    EXPECT_EQ(::chmod(file().c_str(), mode), 0);
    return file();
  }
  static std::string problem_of(const fs::path& file, int code = process::kConfiguration) {
    try {
      read_key(file);
    } catch (const process::Failure& failure) {
      EXPECT_EQ(failure.code(), code) << failure.what();
      const std::string what = failure.what();
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      return what;
    }
    return "";
  }
  cli::TempFolder folder_;
};

TEST_F(KeyFiles, ANewKeyIsTheOwnersAloneAndIsReadAsItWasWritten) {
  const SecretKey key = random_key();
  const mode_t before = ::umask(0);
  write_new_key(file(), key);
  ::umask(before);
  struct stat status {};
  ASSERT_EQ(::stat(file().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 07777, 0600U);
  EXPECT_EQ(status.st_size, 45);
  EXPECT_EQ(read_key(file()), key);
  EXPECT_NE(random_key(), key);
}

TEST_F(KeyFiles, NoKeyIsOverwritten) {
  const SecretKey key = random_key();
  write_new_key(file(), key);
  EXPECT_THROW(write_new_key(file(), random_key()), process::Failure);
  EXPECT_EQ(read_key(file()), key);
  // Nor what a symbolic link leads to.
  const fs::path target = folder_ / "target";
  fs::create_symlink(target, folder_ / "link");
  EXPECT_THROW(write_new_key(folder_ / "link", key), process::Failure);
  EXPECT_FALSE(fs::exists(target));
}

TEST_F(KeyFiles, AKeyOfRfc7748IsRead) {
  for (const std::string end : {"", "\n", "\r\n"}) {
    EXPECT_EQ(to_base64(public_key_of(read_key(write(kAlice + end)))), kAlicePublic);
  }
}

TEST_F(KeyFiles, WhatOthersMayTouchIsRefused) {
  for (const mode_t mode : {0640U, 0604U, 0620U, 0602U, 0666U}) {
    EXPECT_THAT(problem_of(write(kAlice, mode)), HasSubstr("chmod 600")) << mode;
  }
  EXPECT_EQ(problem_of(write(kAlice, 0400)), "");
}

TEST_F(KeyFiles, WhatIsNoKeyIsRefused) {
  const std::string zeros(43, 'A');
  for (const std::string& text :
       {std::string(), std::string("\n"), std::string(kAlice).substr(1), kAlice + std::string("A"),
        " " + std::string(kAlice), kAlice + std::string("\n\n"), std::string(1'000'000, 'A'),
        std::string(44, '\0'), zeros + "=\n"}) {
    EXPECT_THAT(problem_of(write(text)), HasSubstr("44 characters of base64")) << text.size();
  }
  EXPECT_THAT(problem_of(write("secret")), Not(HasSubstr("secret"))) << "nothing of it is shown";
}

TEST_F(KeyFiles, OnlyRegularFilesAreRead) {
  EXPECT_THAT(problem_of(folder_ / "none"), HasSubstr("keys gen --out"));
  EXPECT_THAT(problem_of(folder_.string()), HasSubstr("no regular file"));
  ASSERT_EQ(::mkfifo(file().c_str(), 0600), 0);
  EXPECT_THAT(problem_of(file()), HasSubstr("no regular file")) << "and nobody waits";
}

TEST_F(KeyFiles, OnesOfOtherUsersAreRefused) {
  if (::geteuid() != 0) GTEST_SKIP() << "needs root to give a file away";
  write(kAlice);
  ASSERT_EQ(::chown(file().c_str(), 12345, 12345), 0);
  EXPECT_THAT(problem_of(file()), HasSubstr("belongs to user 12345"));
}

TEST_F(KeyFiles, AKeyInUseIsNotUsedTwice) {
  write(kAlice);
  {
    const OwnKey first(file());
    EXPECT_EQ(to_base64(public_key_of(first.key())), kAlicePublic);
    try {
      const OwnKey second(file());
      ADD_FAILURE() << "two programs with one key";
    } catch (const process::Failure& failure) {
      EXPECT_EQ(failure.code(), process::kFailed);
      EXPECT_THAT(failure.what(), HasSubstr("in use by another program"));
    }
    EXPECT_EQ(problem_of(file()), "") << "`keys pub` may look at it all the same";
  }
  EXPECT_NO_THROW(OwnKey{file()});
}

TEST_F(KeyFiles, TheDefaultPlaceIsOfTheEnvironment) {
  const auto with = [](const char* config, const char* home) {
    config != nullptr ? ::setenv("XDG_CONFIG_HOME", config, 1) : ::unsetenv("XDG_CONFIG_HOME");
    home != nullptr ? ::setenv("HOME", home, 1) : ::unsetenv("HOME");
    return default_key_file();
  };
  const char* home = std::getenv("HOME");
  const std::string before = home != nullptr ? home : "/";
  EXPECT_EQ(with("/c", "/h"), "/c/interneuron/key");
  EXPECT_EQ(with(nullptr, "/h"), "/h/.config/interneuron/key");
  EXPECT_EQ(with("relative", "/h"), "/h/.config/interneuron/key");
  EXPECT_EQ(with(nullptr, nullptr), "");
  with(nullptr, before.c_str());
}

TEST_F(KeyFiles, TheTimeIsKeptBesideTheKey) {
  EXPECT_FALSE(TimeFile(file()).stored());
  EXPECT_EQ(TimeFile(file()).problem(), "") << "none is there yet";
  EXPECT_EQ(TimeFile(file()).store(1'764'000'000'123'456'789), "");
  EXPECT_EQ(TimeFile(file()).stored(), 1'764'000'000'123'456'789);
  EXPECT_EQ(TimeFile(file()).store(5), "") << "the last one counts";
  EXPECT_EQ(TimeFile(file()).stored(), 5);
}

TEST_F(KeyFiles, ATimeThatDoesNotCountIsTold) {
  const fs::path time = file().string() + ".time";
  for (const char* text : {"", "x", "-5\n", "5 6", "99999999999999999999", "9000000000000000000"}) {
    std::ofstream(time) << text;
    EXPECT_FALSE(TimeFile(file()).stored()) << text;
    EXPECT_THAT(TimeFile(file()).problem(), HasSubstr("does not count")) << text;
  }
  std::ofstream(time) << "5";
  ASSERT_EQ(::chmod(time.c_str(), 0666), 0);
  EXPECT_FALSE(TimeFile(file()).stored()) << "anybody may have written it";
  EXPECT_THAT(TimeFile(file()).problem(), HasSubstr("by others"));
  EXPECT_THAT(TimeFile("/proc/nowhere/key").store(5), HasSubstr("cannot write"));
}

}  // namespace
}  // namespace interneuron::settings::key_files_test
