# cmake -DBINARY_DIR= -DSOURCE_DIR= -DGENERATOR= -DCXX_COMPILER= -DCXX_FLAGS= -DBUILD_TYPE= -P, then a test of this folder.
# What the tests of this folder share. Everything happens below ${work}, which is made anew and has a name of the test's.
get_filename_component(work ${CMAKE_SCRIPT_MODE_FILE} NAME_WE)
set(work ${BINARY_DIR}/install_${work})
set(prefix ${work}/prefix)

set(toolchain -G ${GENERATOR} -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${CXX_COMPILER}
  "-DCMAKE_CXX_FLAGS=${CXX_FLAGS} -Wall -Wextra -Wpedantic -Werror" -DCMAKE_BUILD_TYPE=${BUILD_TYPE})

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    string(JOIN " " command ${ARGN})
    message(FATAL_ERROR "${command}\nfailed (${code}):\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${work})
run(${CMAKE_COMMAND} --install ${BINARY_DIR} --prefix ${prefix})
# The examples are copied, so that no header of the source tree can be found by accident.
file(COPY ${SOURCE_DIR}/examples DESTINATION ${work})
# build(FOLDER [argument of cmake...])
function(build source)
  run(${CMAKE_COMMAND} -S ${work}/${source} -B ${work}/build/${source} ${toolchain} ${ARGN})
  set(configured "${output}" PARENT_SCOPE)
  run(${CMAKE_COMMAND} --build ${work}/build/${source})
endfunction()

# What a program says must match the pattern.
function(expect pattern program)
  run(${work}/build/${program} ${ARGN})
  message(STATUS "${program}:\n${output}")
  if(NOT output MATCHES "${pattern}")
    message(FATAL_ERROR "${program} said: ${output}")
  endif()
endfunction()
