# Installs the library of build tree ${library} under ${build}, then configures, builds and
# runs the consumer there, with that and with the sources.
file(REMOVE_RECURSE ${build})

function(run)
  execute_process(COMMAND ${ARGV} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

run(${CMAKE_COMMAND} --install ${library} --prefix ${build}/installed)
function(consume name)
  run(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR} -B ${build}/${name} -G ${generator}
      -D CMAKE_CXX_COMPILER=${compiler} ${ARGN})
  run(${CMAKE_COMMAND} --build ${build}/${name})
  run(${build}/${name}/consumer)
endfunction()
consume(installed_package -D CMAKE_PREFIX_PATH=${build}/installed)
consume(fetched -D CTCR_SOURCE=${CMAKE_CURRENT_LIST_DIR}/../..)
