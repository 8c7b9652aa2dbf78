#include "lab/bench/reports.h"

#include <fmt/format.h>

#include <string>

#include "app/process/whole_file.h"
#include "app/records/run_files.h"

namespace interneuron::bench {
namespace {

void write(const std::filesystem::path& file, const std::string& text) {
  process::WholeFile out(file);
  out.append(text);
  out.commit();
}

std::string mahimahi(const emu::Opportunities& trace) {
  std::string out;
  for (const std::int64_t at : trace.at_ms) out += fmt::format("{}\n", at);
  return out;
}

}  // namespace

void write_profiles(const coding::Drive& drive, std::uint64_t number, const std::string& from,
                    const std::filesystem::path& folder) {
  records::make_directory(folder);
  for (std::size_t i = 0; i < drive.modems.size(); ++i) {
    const coding::Modem& modem = drive.modems[i];
    const std::string name = fmt::format("{}-{}", number, i + 1);
    std::string text = fmt::format(
        "# Source: {}\n"
        "schema = 1\nname = \"drive-{}\"\n"
        "description = \"A modem of a drive\"\nmodel = \"constant\"\n\n"
        "rtt_ms = {}\nloss = 0\n",
        from, name, 2 * to_ms(modem.one_way));
    const auto add = [&](const char* direction, const emu::Opportunities& trace) {
      const std::string file = fmt::format("{}-{}.mahi", name, direction);
      write(folder / file, mahimahi(trace));
      text += fmt::format("\n[{}]\nrate_trace = \"{}\"\n", direction, file);
    };
    add("up", *modem.up);
    add("down", *modem.down);
    write(folder / (name + ".toml"), text);
  }
}

}  // namespace interneuron::bench
