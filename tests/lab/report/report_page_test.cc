// `interneuron report`: the page of a small evaluation.
#include <fstream>
#include <vector>

#include "lab/report/page.h"
#include "tests/app/cli/support.h"
#include "tests/lab/sim/support.h"
#include "tests/places.h"

namespace interneuron::report::report_page_test {
namespace {

namespace fs = std::filesystem;
using cli::Ran;
using cli::run;
using cli::TempFolder;

const std::string kLook = "python3 '" + places::source() + "/tests/lab/report/report_page.py' '";

// Run once for all tests of this file.
class ReportPage : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempFolder;
    std::vector<std::string> experiments{
        "table-network --rounds 300 --seeds 1..1", "fig-adjust --rounds 2 --seeds 1..1", "fig-rt",
        "timeout-handler --rounds 10 --seeds 1..1", "clock --rounds 10 --seeds 1..1"};
    if (!sim::kSanitized) {  // many runs of the same code: minutes
      experiments.insert(
          experiments.end(),
          {"table-erdos --rounds 10 --seeds 1..1", "table-lidar --rounds 3 --seeds 1..1",
           "ladder --rounds 10 --seeds 1..2", "sweep --rounds 5 --seeds 1..1"});
    }
    for (const std::string& experiment : experiments) {
      const Ran ran = run("eval " + experiment + " --out '" + folder_->string() + "'");
      ASSERT_EQ(ran.code, 0) << ran.output;
    }
    made_ = run("report '" + folder_->string() + "'");
  }
  static void TearDownTestSuite() { delete folder_; }
  static Ran look(const std::string& more) {
    Ran ran;
    FILE* pipe = ::popen((kLook + folder_->string() + "'" + more + " 2>&1").c_str(), "r");
    std::array<char, 4096> chunk;
    while (const std::size_t n = std::fread(chunk.data(), 1, chunk.size(), pipe)) {
      ran.output.append(chunk.data(), n);
    }
    ran.code = WEXITSTATUS(::pclose(pipe));
    return ran;
  }

  static TempFolder* folder_;
  static Ran made_;
};
TempFolder* ReportPage::folder_ = nullptr;
Ran ReportPage::made_;

bool installed(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null 2>&1").c_str()) == 0;
}

TEST_F(ReportPage, IsWellFormedAndAsksNobody) {
  if (!installed("gnuplot")) GTEST_SKIP() << "no gnuplot";
  ASSERT_EQ(made_.code, 0) << made_.output;
  const Ran ran = look("");
  EXPECT_EQ(ran.code, 0) << ran.output;
}

TEST_F(ReportPage, IsDrawnByABrowser) {
  if (!installed("gnuplot")) GTEST_SKIP() << "no gnuplot";
  for (const char* browser : {"chromium", "chromium-browser", "google-chrome"}) {
    if (!installed(browser)) continue;
    ASSERT_EQ(made_.code, 0) << made_.output;
    const Ran ran = look(std::string(" ") + browser);
    EXPECT_EQ(ran.code, 0) << ran.output;
    return;
  }
  GTEST_SKIP() << "no Chromium; install the package chromium for this test";
}

TEST(Report, AFolderWithoutExperimentsIsNamed) {
  const TempFolder folder;
  const Ran ran = run("report '" + folder.string() + "'");
  EXPECT_EQ(ran.code, 3) << ran.output;
  EXPECT_NE(ran.output.find(folder.string()), std::string::npos) << ran.output;
  EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
  EXPECT_TRUE(fs::is_empty(folder.string()));
}

TEST(Report, ADamagedFileIsNamed) {
  const TempFolder folder;
  for (const char* text :
       {"{", "{}", R"({"schema": "interneuron.eval/1", "experiment": "sweep"})"}) {
    std::ofstream(folder / "sweep.json") << text;
    const Ran ran = run("report '" + folder.string() + "'");
    EXPECT_EQ(ran.code, 3) << ran.output;
    EXPECT_NE(ran.output.find("sweep"), std::string::npos) << ran.output;
    EXPECT_EQ(std::ranges::count(ran.output, '\n'), 1) << ran.output;
    EXPECT_FALSE(fs::exists(folder / "report.html"));
  }
}

TEST(Report, AFileUnderAnothersNameIsNamed) {
  const TempFolder folder;
  ASSERT_EQ(run("eval fig-rt --out '" + folder.string() + "'").code, 0);
  fs::rename(folder / "fig-rt.json", folder / "clock.json");
  const Ran ran = run("report '" + folder.string() + "'");
  EXPECT_EQ(ran.code, 3) << ran.output;
  EXPECT_NE(ran.output.find("clock.json"), std::string::npos) << ran.output;
}

TEST(Report, TextIsEscapedAndBytesAreEncoded) {
  EXPECT_EQ(escaped("a<b & \"c\""), "a&lt;b &amp; &quot;c&quot;");
  // RFC 4648 §10.
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
}

TEST(ReportTemplate, FillsKeysAndEscapesTexts) {
  EXPECT_EQ(filled("sentence", {{"text", "a<b"}}), "<p>a&lt;b</p>\n");
  EXPECT_EQ(filled("row", {{"cells", "<td>1</td>"}}), "<tr><td>1</td></tr>\n");
  EXPECT_THROW(filled("sentence", {}), std::logic_error);
  EXPECT_THROW(filled("nowhere", {}), std::logic_error);
}

}  // namespace
}  // namespace interneuron::report::report_page_test
