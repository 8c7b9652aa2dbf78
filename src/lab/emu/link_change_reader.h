// Reads a change from a table of a TOML file. Private to src/lab/emu; pure.
#pragma once

#include <string_view>
#include <vector>

#include "host/toml/toml_reader.h"
#include "lab/emu/link_change.h"

namespace interneuron::emu {

// The keys of a change in `section`, which may have `others` as well. False: the reader has an
// error.
bool read_change(TomlReader& reader, const TomlReader::Section& section,
                 const std::vector<std::string_view>& others, const ProfileResolver& resolver,
                 LinkChange& out);

}  // namespace interneuron::emu
