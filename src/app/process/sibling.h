// The programs of the project that stand beside the one that runs. `interneuron` is the door to all
// of them: it becomes the sibling whose command was asked for. Siblings lie in the same folder, as
// in a build, or in kSiblings, as when installed. Whoever can write to those folders can replace
// the programs themselves, so nothing is checked but the version.
#pragma once

#include <string>

namespace interneuron::process {

// Where the siblings of an installed `interneuron` lie, seen from its folder:
// ../libexec/interneuron unless CMAKE_INSTALL_BINDIR or CMAKE_INSTALL_LIBEXECDIR says otherwise.
extern const char* const kSiblings;

// The path of the program that runs. Throws Failure (1).
std::string own_program();

// The path of the sibling `name`. Throws Failure (1) where there is none, with what to install or
// build.
std::string sibling_program(const std::string& name);

// Becomes the sibling `name` with these arguments, argv[0] included, which it then takes for its
// own: process id, signals and open files stay. `version` is ours; a sibling of another one
// refuses. Throws Failure (1).
[[noreturn]] void become_sibling(const std::string& name, const std::string& version, char** argv);

// What a sibling does first: refuses, by a Failure (1), to go on for a starter of another version.
void refuse_other_version(const std::string& version);

}  // namespace interneuron::process
