// @ts-check
/**
 * What comes over the wire and what the page keeps. Types only, known in every module:
 * this file is no module itself, and no browser loads it.
 * Steps are 0-based; boxes are `[left, top, width, height]` in pixels; positions are metres.
 *
 * @typedef {[number, number, number, number]} Box
 * @typedef {Node | string | number | null | undefined | false} Child  of an element
 * @typedef {{code: string, message: string, field: string | null, hint: string | null}} ApiFailure
 *
 * @typedef {object} CameraInfo
 * @property {string} name
 * @property {number} width
 * @property {number} height
 * @property {boolean} has_pictures
 * @property {boolean} has_detections
 *
 * @typedef {object} SequenceInfo
 * @property {string} key  changes with the content, so that pictures may be cached for ever
 * @property {string} name
 * @property {string} description
 * @property {number} fps
 * @property {number} frames
 * @property {boolean} has_pictures
 * @property {boolean} has_detections
 * @property {boolean} has_truth
 * @property {CameraInfo[]} cameras
 * @property {number} templates
 *
 * @typedef {object} RunState
 * @property {string} key
 * @property {"idle" | "computing" | "done" | "failed" | "cancelled"} state
 * @property {number} done  steps that are computed
 * @property {number} total
 * @property {number | null} steps_per_second
 * @property {number | null} seconds_left
 * @property {string | null} message  the stage that takes the time
 * @property {string | null} error
 *
 * @typedef {object} ServerState
 * @property {number} version
 * @property {SequenceInfo | null} sequence
 * @property {{name: string, message: string, done: number, total: number} | null} opening
 * @property {Record<string, any>} parameters  in the page with the methods among them
 * @property {string[]} changed
 * @property {{single_view: string, fusion_method: string}} methods
 * @property {number} playhead
 * @property {number | null} selection
 * @property {RunState} run
 * @property {{key: string, changed: string[]} | null} pinned
 * @property {{path: string}} viser
 * @property {Record<string, boolean>} layers  of the 3D view
 * @property {number | "top" | null} view  what the 3D view looks through
 * @property {"dark" | "light"} theme
 *
 * @typedef {object} TrackInView
 * @property {number} id
 * @property {Box | null} box
 * @property {boolean} seen
 * @property {number | null} detection_probability
 * @property {number} source  index of the box that fed it, -1 where none did
 * @property {{box: Box, weight: number, share: number} | null} fed_by
 * @property {number | null} hidden_by
 * @property {boolean} visible
 * @property {string | null} reason
 * @property {[number, number] | null} centre
 * @property {[number, number, number][]} trail  steps from now, x and y of the feet
 *
 * @typedef {{kind: string, labels: number[]}} ViewEvent  labels of the camera's own estimates
 *
 * @typedef {object} CameraStep
 * @property {string} name
 * @property {{box: Box, score: number}[]} measurements
 * @property {{box: Box, weight: number, label: number}[]} estimates
 * @property {[number, number, number][] | null} [samples]
 * @property {ViewEvent[]} events
 * @property {Record<string, number>} information  of the method, by name
 * @property {string | null} foreground  the query of its address, null where there is none
 * @property {string | null} likelihood  the same of the map of likelihoods
 * @property {[number, number, number, number, number][]} gates  centre x and y; xx, xy, yy of the ellipse's matrix
 * @property {TrackInView[]} tracks
 * @property {{id: number, box: Box | null, valid: boolean}[]} truth
 *
 * @typedef {object} StepResult
 * @property {string} run
 * @property {number} step
 * @property {boolean} computed
 * @property {CameraStep[]} cameras
 * @property {{id: number, position: number[], sigma: number[], existence: number, seen: boolean[]}[]} tracks
 * @property {{id: number, position: number[], valid: boolean, track: number | null, error: number | null}[]} truth
 * @property {number} components
 * @property {number} cardinality
 *
 * @typedef {[number, number, "seen" | "coasting" | "long miss"]} Span  from and to are inclusive
 * @typedef {{id: number, first: number, last: number, seen: number, spans: Span[]}} TrackLane  seen: share of its life
 * @typedef {{first: number, stride: number}} Buckets  each value stands for `stride` steps, the first from step `first` on
 * @typedef {{low: number[], high: number[], mean: number[]}} Summary  of each bucket
 *
 * @typedef {object} Timeline
 * @property {string} run
 * @property {number} done
 * @property {number} frames
 * @property {number} first
 * @property {number} stride
 * @property {Summary} cardinality
 * @property {Summary} count
 * @property {Summary | null} truth
 * @property {TrackLane[]} tracks
 * @property {{run: string, count: Summary, tracks: (TrackLane & {like: number | null})[]} | null} pinned  like: the shown run's track
 * @property {[number, number, "birth" | "death" | "long miss"][]} events  step and track
 * @property {number} left_out
 *
 * @typedef {object} Parameter
 * @property {string} key
 * @property {string} group
 * @property {string} name
 * @property {string} label
 * @property {string} help
 * @property {string} symbol
 * @property {string} unit
 * @property {string} kind
 * @property {any} default
 *
 * @typedef {object} Schema
 * @property {{name: string, help: string}[]} groups
 * @property {Parameter[]} parameters
 * @property {Record<string, string[]>} methods
 * @property {Record<string, Record<string, any>>} presets
 *
 * @typedef {object} SequenceEntry
 * @property {string} name
 * @property {string} description
 * @property {"rendered" | "folder"} kind
 * @property {number | null} cameras
 * @property {number | null} frames
 * @property {boolean} ready
 * @property {string | null} [error]
 *
 * @typedef {{id: number, level: "info" | "warn" | "error", title: string, text: string}} Note
 *
 * @typedef {object} PageState
 * @property {"connecting" | "open" | "lost"} link
 * @property {number} lostAt  milliseconds since 1970
 * @property {number} retryAt  milliseconds since 1970
 * @property {ServerState | null} server
 * @property {RunState | null} run  the newest progress, also between two states
 * @property {Schema | null} schema
 * @property {SequenceInfo | null} sequence  that is open, and of it:
 * @property {number} frames
 * @property {number} fps
 * @property {CameraInfo[]} cameras
 * @property {SequenceEntry[]} sequences
 * @property {string} basis  key of the run that the server shows: that in `run`, or while that has no step yet, one before
 * @property {Timeline | null} timeline  always of the run `basis`
 * @property {[number, number] | null} span  steps that the timeline shows of a long recording; null: all of them
 * @property {number} step  what is asked for
 * @property {number} shown  what is painted
 * @property {StepResult | null} result  of the painted step
 * @property {number} loaded  counts up whenever a picture arrives or leaves
 * @property {0 | 1 | -1} playing
 * @property {number} speed
 * @property {boolean} loop
 * @property {[number | null, number | null]} range  in and out points
 * @property {number | null} selection
 * @property {{id: number, camera: number} | null} hover
 * @property {Record<string, boolean>} layers2d
 * @property {Record<string, boolean>} layers3d
 * @property {number | null} large  the camera that is shown large; null: all alike
 * @property {"tracks" | "step" | "events" | "changes" | "compare" | "runs"} tab
 * @property {"" | LaneEvent["kind"]} eventKind  the events that are listed and gone to; all where empty
 * @property {boolean} every  whether all figures are compared, or the headlines
 * @property {Scores | null} scores  of the run that was set against the truth last
 * @property {"ospa" | "gospa"} measure  what the timeline plots
 * @property {"longest" | "born"} laneOrder
 * @property {{right?: number, cams?: number, lanes?: number, max?: PaneName}} layout  shares of the window, and the pane that is alone
 * @property {"dark" | "light"} theme
 * @property {boolean} singleKeys
 * @property {Note[]} notes
 *
 * @typedef {{id: number, kind: string, person: number | null, mean_error: number | null, switches: number}} ScoredTrack
 * @typedef {{run: string, steps: number, partial: boolean, per_track: ScoredTrack[]}} Evaluation
 * @typedef {{first: number, values: (number | null)[]}} Course  metres over the steps; null where there is no pair
 * @typedef {{step: number, before: number, track: number}} Switch  of a person's identity, from one track to another
 *
 * @typedef {object} ScoreSeries
 * @property {string} run
 * @property {number} first
 * @property {number} stride
 * @property {string} unit
 * @property {string} cost  cut-off and order, in words
 * @property {string} gate
 * @property {number[]} ospa
 * @property {number[]} ospa_localisation
 * @property {number[]} ospa_cardinality
 * @property {number[]} gospa
 * @property {number[]} gospa_localisation
 * @property {number[]} gospa_missed
 * @property {number[]} gospa_false
 * @property {number[]} ospa_share  how much of it is location, 0 … 1
 * @property {number[]} gospa_share
 * @property {(Course & {track: number})[]} track_errors
 * @property {(number | null)[]} mean_error
 * @property {{ospa: number, gospa: number, error: number}} axes  upper ends for plots
 * @property {Switch[]} switches
 *
 * @typedef {{evaluation: Evaluation, series: ScoreSeries, reference: ScoreSeries | null}} Scores
 *
 * @typedef {"view" | "cams" | "side" | "time"} PaneName
 *
 * @typedef {object} Command
 * @property {string} name
 * @property {string} title
 * @property {"Play" | "Cameras and 3D" | "Tracks" | "Parameters" | "Page"} group
 * @property {string[]} keys
 * @property {string} action  a name of `Actions`
 * @property {any} [value]  its argument
 *
 * @typedef {object} Actions  what a person can do
 * @property {(level: "info" | "warn" | "error", title: string, text: string) => void} note
 * @property {(method: "POST" | "PATCH" | "DELETE", path: string, body?: object) => Promise<any>} ask  null after a failure, which is told
 * @property {() => void} togglePlay
 * @property {(direction: -1 | 0 | 1) => void} shuttle
 * @property {(steps: number) => void} stepBy
 * @property {(seconds: number) => void} secondsBy
 * @property {(direction: -1 | 1) => void} changeSpeed
 * @property {() => void} toggleLoop
 * @property {(end: 0 | 1) => void} markRange
 * @property {(direction: -1 | 1) => void} toEvent
 * @property {(id: number | null) => void} select
 * @property {(direction: -1 | 1) => void} nextTrack
 * @property {(place: string) => void} go  to an event: its step and track
 * @property {() => void} clear
 * @property {() => void} exportTracks
 * @property {(index: number) => void} chooseCamera  as the large picture
 * @property {(view: number | "top" | null) => void} lookThrough  in 3D; null is the free view
 * @property {() => void} freeView
 * @property {(layer: string) => void} toggleLayer  in the pictures and in 3D
 * @property {(layer: string) => void} toggleLayer2d
 * @property {(layer: string) => void} toggleLayer3d
 * @property {(name: string) => Promise<any>} open
 * @property {(changes: Record<string, any>) => Promise<any>} change
 * @property {(...keys: string[]) => void} reset
 * @property {(name: string) => void} preset
 * @property {() => void} cancel
 * @property {() => void} runAgain
 * @property {(on: boolean) => void} pin
 * @property {(before: Record<string, any>, after: Record<string, any>) => void} remember  what the parameters were, whoever changed them
 * @property {() => void} forget  what can be undone
 * @property {(direction: -1 | 1) => void} undo  or redo
 * @property {(what: "command" | "json") => void} copyRun
 * @property {(tab: PageState["tab"]) => void} showTab
 * @property {() => void} toggleTheme
 * @property {(pane: PaneName | null) => void} maximise  null: all panes as they were at first
 * @property {() => void} help
 * @property {() => void} palette
 * @property {(factor: number) => void} zoom  of the timeline; above 1 shows more steps
 *
 * @typedef {object} Frame  what is painted at once
 * @property {number} step
 * @property {(Picture | undefined)[]} pictures  by camera; undefined where it is not loaded and will not be
 * @property {Picture[][]} maps  by camera: what is laid over its picture
 * @property {StepResult | null} result
 * @property {boolean} stale  the result is of the run before, shown faintly until the new one is there
 *
 * @typedef {object} Context  what every pane is given
 * @property {Store<PageState>} store
 * @property {ReturnType<typeof import("./playback.js").createPlayback>} playback
 * @property {Actions} actions
 * @property {() => void} retry  connect now
 * @property {(event: KeyboardEvent) => boolean} press  run the command of a key; whether there was one
 * @typedef {(root: HTMLElement, context: Context) => void} Pane  fills its part of the page and keeps it current
 *
 * @typedef {{y: number, height: number}} Row  of the timeline, CSS pixels
 * @typedef {{g: Brush, row: Row, view: View, ink: Palette}} Pen  what a row is drawn with
 *
 * @typedef {object} Lanes
 * @property {TrackLane[]} tracks  in the order of the lanes
 * @property {(TrackLane & {like: number | null})[]} pinned
 * @property {number} scroll  pixels
 * @property {number} laneHeight
 * @property {number} done
 * @property {number | null} selection
 * @property {number | null} hover
 * @property {Switch[]} switches
 *
 * @typedef {{first: number, last: number, width: number}} View  the steps an axis of `width` CSS pixels shows
 * @typedef {{step: number, id: number, kind: "birth" | "death" | "long miss" | "switch"}} LaneEvent
 * @typedef {{x: number, y: number, width: number, height: number}} Cell  of the mosaic of pictures
 * @typedef {{sequence: string | null, step: number | null, selection: number | null, camera: number | null, values: Record<string, any> | null}} Place  values: what differs from the defaults
 * @typedef {{bitmap: ImageBitmap | null, missing: string | null}} Picture
 * @typedef {{key: string, number: number, at: string, sequence: string, state: string, done: number, total: number, speed: string, changes: number, parameters: Record<string, any>}} PastRun
 *
 * @typedef {object} Palette
 * @property {(name: string) => string} get  a token without its dashes
 * @property {(id: number) => string} id
 * @property {(id: number) => string} on  ink on the colour of an id
 * @property {string} font
 *
 * @typedef {object} Scene
 * @property {number} scale  CSS pixels a picture pixel
 * @property {number} width  CSS pixels
 * @property {number} height  CSS pixels
 * @property {Record<string, boolean>} layers
 * @property {number | null} selection
 * @property {number | null} hover
 * @property {boolean} alone  only the selected track
 * @property {StepResult["truth"]} people
 * @property {number} opacity
 * @property {Palette} ink
 */

/**
 * @template {object} T
 * @typedef {object} Store
 * @property {() => Readonly<T>} get
 * @property {(patch: Partial<T>) => void} set
 * @property {(keys: (keyof T)[], listener: (state: Readonly<T>) => void) => () => void} on
 */

/**
 * @template R
 * @typedef {object} Column  of a table
 * @property {string} word
 * @property {string} [kind]  classes
 * @property {(row: R) => string | number | Child | Child[]} cell
 * @property {(row: R) => number} [by]  makes it sortable
 * @property {boolean} [live]  changes with the shown step
 */

/**
 * @template R
 * @typedef {object} Grid  a table
 * @property {HTMLElement} element
 * @property {(rows: R[]) => void} show
 * @property {() => void} live  fill the columns that change with the step
 * @property {(act: (row: R, element: HTMLTableRowElement) => void) => void} each
 */

/** @typedef {CanvasRenderingContext2D} Brush */

/**
 * @template V
 * @typedef {object} Kept  things that belong to a step
 * @property {(names: string[]) => void} want
 * @property {(name: string) => V | undefined} get
 * @property {(name: string, value: V) => void} put
 * @property {(name: string) => void} forget
 * @property {() => void} clear
 * @property {() => IterableIterator<string>} names
 */

/**
 * @template V
 * @typedef {object} CacheHow
 * @property {(name: string, signal: AbortSignal) => Promise<V>} load
 * @property {(value: V) => number} sizeOf
 * @property {number} budget  in the unit of `sizeOf`
 * @property {number} [parallel]  requests at a time
 * @property {(name: string) => void} arrived
 * @property {(value: V) => void} [dispose]
 * @property {(name: string, error: unknown) => V | undefined} failed  a value stands for the failure and is
 *   kept; without one the name may be wanted again
 */
