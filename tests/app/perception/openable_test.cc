// With too many files open nothing is wrong with a file, and fetching it anew would not help.
#include "app/perception/openable.h"

#include <sys/resource.h>
#include <unistd.h>

#include "app/perception/accuracy.h"
#include "app/perception/frame_source.h"
#include "support.h"

namespace interneuron::perception::openable_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// While it lives this process can open no further file.
class NoDescriptors {
 public:
  NoDescriptors() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const int next = ::dup(STDERR_FILENO);
    ::close(next);
    const rlimit none{static_cast<rlim_t>(next), before_.rlim_max};
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;
  ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }

 private:
  rlimit before_{};
};

// What is thrown meanwhile; "input" before it, if that blames the input. The limit is lifted before
// anybody looks at what was thrown: UBSan opens a pipe to see whether an object's memory is there.
template <class Action>
std::string complaint_without_descriptors(Action action) {
  try {
    const NoDescriptors none;
    action();
  } catch (const InputError& error) {
    return std::string("input ") + error.what();
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

TEST(Openable, TooManyOpenFilesIsToldAsSuch) {
  const TempDir dir;
  write_text(dir / "gt.txt", "1,1,10,10,20,20,1,-1,-1,-1\n");
  write_text(dir / "video.avi", "x");
  write_text(dir / "cloud.bin", "x");
  const auto is_told = [](const std::string& file) {
    return AllOf(HasSubstr(file), HasSubstr("Too many open files"), HasSubstr("ulimit -n"),
                 Not(HasSubstr("fetch_data")), Not(HasSubstr("input ")));
  };
  EXPECT_THAT(complaint_without_descriptors([&] { read_mot_truth(dir / "gt.txt"); }),
              is_told("gt.txt"));
  EXPECT_THAT(complaint_without_descriptors([&] { FrameSource((dir / "video.avi").string()); }),
              is_told("video.avi"));
  EXPECT_THAT(complaint_without_descriptors([&] { check_openable("model", dir / "cloud.bin"); }),
              is_told("cloud.bin"));
}

TEST(Openable, OtherReasonsAreLeftToTheCaller) {
  const TempDir dir;
  EXPECT_NO_THROW(check_openable("model", dir / "none"));
  EXPECT_THAT(complaint([&] { read_mot_truth(dir / "none"); }), HasSubstr("fetch_data"));
}

}  // namespace
}  // namespace interneuron::perception::openable_test
