#include <gmock/gmock.h>

#include <fstream>

#include "support.h"

namespace interneuron::netns {
namespace {

using testing::HasSubstr;

std::string refusal(const std::string& what) {
  try {
    load_link(what);
  } catch (const TestbedError& error) {
    EXPECT_EQ(error.exit_code, 3);
    return error.what();
  }
  return "none";
}

TEST(LinkSpec, DefaultIs5gThen4g) {
  const auto links = default_links();
  ASSERT_EQ(links.size(), 2U);
  EXPECT_EQ(links[0].name, "5g");
  EXPECT_EQ(links[1].name, "4g");
  EXPECT_EQ(links[1].profile.delay.max_ms, 994);
}

TEST(LinkSpec, NamesABuiltInProfileOrAFileOrBoth) {
  EXPECT_EQ(load_link("clean").name, "clean");
  EXPECT_EQ(load_link("second=5g").name, "second");
  EXPECT_EQ(load_link("second=5g").profile.name, "5g");
  const std::string file = INTERNEURON_SOURCE_DIR "/tc_profiles/4g.toml";
  EXPECT_EQ(load_link(file).name, "4g");
  EXPECT_EQ(load_link("lte=" + file).name, "lte");
}

TEST(LinkSpec, SaysWhatIsWrong) {
  EXPECT_THAT(refusal("6g"), HasSubstr("no profile '6g'; there are 4g, 5g, clean"));
  EXPECT_THAT(refusal("./nowhere.toml"), HasSubstr("./nowhere.toml"));
  const RuntimeDir dir;
  const std::string file = dir.path() / "bad.toml";
  std::ofstream(file) << "schema = 1\nmodell = \"constant\"\n";
  EXPECT_THAT(refusal(file),
              HasSubstr("bad.toml:2:1: unknown key 'modell'; did you mean 'model'?"));
}

}  // namespace
}  // namespace interneuron::netns
