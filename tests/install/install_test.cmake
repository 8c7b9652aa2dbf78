# cmake -DBINARY_DIR= -DSOURCE_DIR= -DGENERATOR= -DCXX_COMPILER= -DCXX_FLAGS= -DBUILD_TYPE= -P install_test.cmake
# Everything happens below BINARY_DIR/install_test, which is made anew.
cmake_minimum_required(VERSION 3.25)
set(work ${BINARY_DIR}/install_test)
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

# A build of the program alone, as scripts/demo.sh makes it, must leave everything that is installed.
if(GENERATOR STREQUAL "Ninja" AND EXISTS ${BINARY_DIR}/interneuron)
  run(${CMAKE_COMMAND} --build ${BINARY_DIR} --target interneuron -- -t query interneuron)
  if(NOT output MATCHES "libinterneuron.a")
    message(FATAL_ERROR "the program does not depend on the library:\n${output}")
  endif()
endif()

file(REMOVE_RECURSE ${work})
run(${CMAKE_COMMAND} --install ${BINARY_DIR} --prefix ${prefix})
# The examples are copied, so that no header of the source tree can be found by accident.
file(COPY ${SOURCE_DIR}/examples DESTINATION ${work})
function(build source)
  run(${CMAKE_COMMAND} -S ${work}/${source} -B ${work}/build/${source} ${toolchain})
  run(${CMAKE_COMMAND} --build ${work}/build/${source})
endfunction()
build(examples)
build(examples/own_policy)

# What a program says must match the pattern.
function(expect pattern program)
  run(${work}/build/${program} ${ARGN})
  message(STATUS "${program}:\n${output}")
  if(NOT output MATCHES "${pattern}")
    message(FATAL_ERROR "${program} said: ${output}")
  endif()
endfunction()
expect("road: hello\n" examples/hello)
expect("vehicle: delivered after [0-9.]+ ms\n" examples/hello)
foreach(example camera_offload lidar_offload four_stages)
  expect("^${example}: " examples/${example} --help)
endforeach()
expect("camera  9: " examples/camera_offload)
expect("lidar  9: " examples/lidar_offload)
expect("camera  [0-9]: +[0-9.]+ ms remote detected, tracked\n.*lidar   9: " examples/four_stages)
expect("patient +variant 0 over link 3;" examples/own_policy/own_policy)
