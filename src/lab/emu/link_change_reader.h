// Reads a change from a table of a TOML file. Private to src/lab/emu; pure.
#pragma once

#include <string_view>
#include <vector>

#include "app/toml/toml_reader.h"
#include "lab/emu/link_change.h"

namespace interneuron::emu {

// Reads the keys of a change from `section`, in which the keys `others` may stand as well. Returns
// false when the reader has an error.
bool read_change(toml_reader::TomlReader& reader, const toml_reader::TomlReader::Section& section,
                 const std::vector<std::string_view>& others, const ProfileResolver& resolver,
                 LinkChange& out);

}  // namespace interneuron::emu
